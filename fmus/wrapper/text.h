/* Texts in UTF-8, without printf: the library for Windows brings no C library of its own, and the system's has none. */
#ifndef COSIM_WRAPPER_TEXT_H
#define COSIM_WRAPPER_TEXT_H

#include <stddef.h>

/* Room for a message that names paths. */
enum { MESSAGE_SIZE = 2048 };

/* Write the texts that follow, one after the other up to the first NULL, to `into`; what goes beyond `size` bytes is
 * cut. */
void compose(char *into, size_t size, ...);

/* A copy of `text`, to be freed; NULL without memory. */
char *copy_of(const char *text);

#endif
