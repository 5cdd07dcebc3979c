/* See system.h: Linux and macOS. */
#ifndef _WIN32
#define _GNU_SOURCE
#include "system.h"
#include "text.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wchar.h>

/* A shared library on macOS is not given it by the linker. */
#ifdef __APPLE__
#include <crt_externs.h>
#define ENVIRONMENT (*_NSGetEnviron())
#else
extern char **environ;
#define ENVIRONMENT environ
#endif

const char *const DEFAULT_PYTHON = "python3";

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

void lock(void) { pthread_mutex_lock(&mutex); }

void unlock(void) { pthread_mutex_unlock(&mutex); }

int process_has_python(void **library) {
    *library = RTLD_DEFAULT;
    return dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL;
}

void *open_library(const char *path, char *why, size_t size) {
    void *library = dlopen(path, RTLD_NOW | RTLD_GLOBAL);
    if (library == NULL) compose(why, size, dlerror(), NULL);
    return library;
}

void *find_function(void *library, const char *name) { return dlsym(library, name); }

char *environment(const char *name) {
    const char *value = getenv(name);
    return value == NULL || *value == '\0' ? NULL : copy_of(value);
}

/* All that comes out of the pipe `end`, of which `size` bytes are kept. */
static void read_all(int end, char *text, size_t size) {
    size_t length = 0;
    char rest[256];
    for (;;) {
        int full = length + 1 == size;
        ssize_t count = read(end, full ? rest : text + length, full ? sizeof rest : size - 1 - length);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) break;
        if (!full) length += (size_t)count;
    }
    text[length] = '\0';
}

int ask(const char *program, const char *question, char *answer, size_t size) {
    int ends[2];
    if (pipe(ends) != 0) return -1;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_addclose(&actions, ends[0]);
    posix_spawn_file_actions_addclose(&actions, ends[1]);
    char *const words[] = {(char *)program, "-c", (char *)question, NULL};
    pid_t child = 0;
    int failed = posix_spawnp(&child, program, &actions, NULL, words, ENVIRONMENT);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    if (!failed) read_all(ends[0], answer, size);
    close(ends[0]);
    int status = 0;
    if (failed) return -1;
    while (waitpid(child, &status, 0) == -1 && errno == EINTR) {
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? 0 : -1;
}

wchar_t *wide_path(void *python, const char *path) {
    wchar_t *(*decode)(const char *, size_t *) = NULL;
    *(void **)&decode = dlsym(python, "Py_DecodeLocale");
    return decode == NULL ? NULL : decode(path, NULL);
}

FILE *open_file(const char *path) { return fopen(path, "rb"); }
#endif
