/* See text.h. */
#include "text.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

void compose(char *into, size_t size, ...) {
    va_list texts;
    va_start(texts, size);
    size_t length = 0;
    for (const char *text = va_arg(texts, const char *); text != NULL; text = va_arg(texts, const char *)) {
        for (; *text != '\0' && length + 1 < size; text++) into[length++] = *text;
    }
    into[length] = '\0';
    va_end(texts);
}

char *copy_of(const char *text) {
    size_t size = strlen(text) + 1;
    char *copy = malloc(size);
    return copy == NULL ? NULL : memcpy(copy, text, size);
}
