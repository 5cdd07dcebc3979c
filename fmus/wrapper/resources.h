/* Where the resources of an FMU are, and what is in their load.py. */
#ifndef COSIM_WRAPPER_RESOURCES_H
#define COSIM_WRAPPER_RESOURCES_H

/* The path in a URI of the forms file:///path, file:/path and file://localhost/path (FMI 2), or a plain path (FMI 3),
 * without a separator at its end; to be freed, NULL if it is neither. */
char *path_of(const char *location);

/* `folder`/`name`, to be freed; NULL without memory. */
char *path_in(const char *folder, const char *name);

/* The content of a text file, to be freed; NULL if it cannot be read. */
char *content_of(const char *path);

#endif
