/* What operating systems do differently, in a file each: system_posix.c for Linux and macOS, system_windows.c. All
 * texts are in UTF-8, those of paths in the encoding that Python calls the file system's. */
#ifndef COSIM_WRAPPER_SYSTEM_H
#define COSIM_WRAPPER_SYSTEM_H

#include <stddef.h>
#include <wchar.h>
#include <stdio.h>

/* The command of Python where nobody names another. */
extern const char *const DEFAULT_PYTHON;

/* One thread at a time between the two. */
void lock(void);
void unlock(void);

/* Whether there is a Python in this process; `library` is then what find_function finds its functions in. */
int process_has_python(void **library);

/* A shared library, its functions visible to those that are loaded later; NULL with the reason in `why`. */
void *open_library(const char *path, char *why, size_t size);

/* The function `name`; NULL if `library` has none. */
void *find_function(void *library, const char *name);

/* An environment variable, to be freed; NULL if it is not set or empty. */
char *environment(const char *name);

/* What `program -c question` prints, cut at `size` bytes; -1 if it cannot be run or fails. */
int ask(const char *program, const char *question, char *answer, size_t size);

/* A path as Python takes it, never freed; NULL if that cannot be. `python` is its library. */
wchar_t *wide_path(void *python, const char *path);

/* A file to be read as bytes, or NULL. */
FILE *open_file(const char *path);

#endif
