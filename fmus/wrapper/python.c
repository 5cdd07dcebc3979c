/* See python.h. Where the host has no Python, the environment variable COSIM_PYTHON names the one to take, else it is the
 * `python3` on the path. It is asked for its shared library, which is loaded so that extension modules find it as well. */
#define _GNU_SOURCE
#include "python.h"

#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <wchar.h>

struct python python;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int started;

/* What a Python says of itself, a line each: its shared library (empty without one) and its executable. */
static const char *QUESTION =
    "import os, sys, sysconfig\n"
    "get = sysconfig.get_config_var\n"
    "folders = [get('LIBDIR'), os.path.join(sys.base_prefix, 'lib'), get('LIBPL')]\n"
    "names = [get('INSTSONAME'), get('LDLIBRARY')]\n"
    "paths = [os.path.join(f, n) for f in folders for n in names if f and n and '.so' in n]\n"
    "print(next(filter(os.path.isfile, paths), ''))\n"
    "print(sys.executable)\n";

/* The answer of the executable `program`, at most `size` bytes; -1 if it cannot be run. */
static int ask(const char *program, char *answer, size_t size) {
    int ends[2];
    if (pipe(ends) != 0) return -1;
    pid_t child = fork();
    if (child == -1) {
        close(ends[0]);
        close(ends[1]);
        return -1;
    }
    if (child == 0) {
        dup2(ends[1], STDOUT_FILENO);
        close(ends[0]);
        close(ends[1]);
        execlp(program, program, "-c", QUESTION, (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    size_t length = 0;
    for (;;) {
        ssize_t count = read(ends[0], answer + length, size - 1 - length);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) break;
        length += (size_t)count;
    }
    close(ends[0]);
    answer[length] = '\0';
    int status = 0;
    while (waitpid(child, &status, 0) == -1 && errno == EINTR) {
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? 0 : -1;
}

/* Fill the table from `library`; -1 and the missing function in `why` if it is no Python that will do. */
static int resolve(void *library, char *why, size_t size) {
#define RESOLVE(result, name, arguments)                                                                       \
    *(void **)&python.name = dlsym(library, #name);                                                            \
    if (python.name == NULL) {                                                                                 \
        snprintf(why, size, "the Python of this process lacks the function " #name "; Python 3.11 to 3.13 will do"); \
        return -1;                                                                                             \
    }
    PYTHON_FUNCTIONS(RESOLVE)
#undef RESOLVE
    return 0;
}

/* Load the Python of COSIM_PYTHON, or the one on the path, into a host that has none. */
static int load(char *why, size_t size) {
    const char *chosen = getenv("COSIM_PYTHON");
    const char *program = chosen != NULL && *chosen != '\0' ? chosen : "python3";
    char answer[8192];
    if (ask(program, answer, sizeof answer) != 0) {
        snprintf(why, size,
                 "this FMU needs Python, and the command %s does not run; set the environment variable COSIM_PYTHON to the "
                 "executable of a Python with NumPy, SciPy and scikit-fem",
                 program);
        return -1;
    }
    char *end = strchr(answer, '\n');
    char *executable = end == NULL ? answer + strlen(answer) : end + 1;
    if (end != NULL) *end = '\0';
    executable[strcspn(executable, "\n")] = '\0';
    if (answer[0] == '\0') {
        snprintf(why, size,
                 "the Python at %s has no shared library that a program without Python could load; install it (Debian: "
                 "libpython3-dev) or set COSIM_PYTHON to another Python",
                 executable);
        return -1;
    }
    void *library = dlopen(answer, RTLD_NOW | RTLD_GLOBAL);
    if (library == NULL) {
        snprintf(why, size, "the shared library of the Python at %s cannot be loaded: %s", executable, dlerror());
        return -1;
    }
    if (resolve(library, why, size) != 0) return -1;
    if (!python.Py_IsInitialized()) {
        /* By its executable a Python finds its packages, those of a virtual environment too. */
        wchar_t *(*decode)(const char *, size_t *) = NULL;
        void (*name)(const wchar_t *) = NULL;
        *(void **)&decode = dlsym(library, "Py_DecodeLocale");
        *(void **)&name = dlsym(library, "Py_SetProgramName");
        if (decode != NULL && name != NULL) name(decode(executable, NULL));
    }
    return 0;
}

int start_python(char *why, size_t size) {
    int result = 0;
    pthread_mutex_lock(&lock);
    if (!started) {
        result = dlsym(RTLD_DEFAULT, "Py_IsInitialized") != NULL ? resolve(RTLD_DEFAULT, why, size) : load(why, size);
        if (result == 0) {
            if (!python.Py_IsInitialized()) {
                /* Without its signal handlers: signals belong to the host. Never finalised: NumPy could not be loaded again. */
                python.Py_InitializeEx(0);
                python.PyEval_SaveThread();
            }
            started = 1;
        }
    }
    pthread_mutex_unlock(&lock);
    return result;
}
