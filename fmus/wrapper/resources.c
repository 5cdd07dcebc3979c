/* See resources.h. */
#include "resources.h"
#include "system.h"
#include "text.h"

#include <stdlib.h>
#include <string.h>

static int hexadecimal(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
    if (digit >= 'A' && digit <= 'F') return digit - 'A' + 10;
    return -1;
}

/* Replace %20 and the like, in place. */
static void decode(char *text) {
    char *to = text;
    for (const char *from = text; *from != '\0';) {
        int high = from[0] == '%' ? hexadecimal(from[1]) : -1;
        int low = high < 0 ? -1 : hexadecimal(from[2]);
        *to++ = low < 0 ? *from : (char)(16 * high + low);
        from += low < 0 ? 1 : 3;
    }
    *to = '\0';
}

#ifdef _WIN32
static int ends_in_separator(char last) { return last == '/' || last == '\\'; }

/* Where the path begins in what follows file: in a URI. `/C:/folder` has a slash too many, and `//server/folder` is a
 * path. */
static const char *local(const char *rest) {
    if (strncmp(rest, "//localhost/", 12) == 0) rest += 11;
    if (strncmp(rest, "///", 3) == 0) rest += 2;
    return rest;
}

static char *without_slash(char *path) {
    int drive = path[0] == '/' && path[1] != '\0' && path[2] == ':';
    if (drive) memmove(path, path + 1, strlen(path));
    return path;
}
#else
static int ends_in_separator(char last) { return last == '/'; }

/* Where the path begins in what follows file: in a URI. */
static const char *local(const char *rest) { return strncmp(rest, "//", 2) == 0 ? strchr(rest + 2, '/') : rest; }

static char *without_slash(char *path) { return path; }
#endif

char *path_of(const char *location) {
    int encoded = strncmp(location, "file:", 5) == 0;
    const char *from = encoded ? local(location + 5) : location;
    char *path = from == NULL ? NULL : copy_of(from);
    if (path == NULL) return NULL;
    if (encoded) {
        decode(path);
        without_slash(path);
    }
    size_t length = strlen(path);
    while (length > 1 && ends_in_separator(path[length - 1])) path[--length] = '\0';
    return path;
}

char *path_in(const char *folder, const char *name) {
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = malloc(size);
    if (path != NULL) compose(path, size, folder, "/", name, NULL);
    return path;
}

char *content_of(const char *path) {
    FILE *file = open_file(path);
    if (file == NULL) return NULL;
    char *text = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        long size = ftell(file);
        rewind(file);
        text = size < 0 ? NULL : malloc((size_t)size + 1);
        if (text != NULL) text[fread(text, 1, (size_t)size, file)] = '\0';
    }
    fclose(file);
    return text;
}
