/* See python.h. Where the host has no Python, the environment variable COSIM_PYTHON names the one to take, else it is
 * the `python3` (on Windows the `python`) on the path. It is asked for its shared library, which is loaded so that
 * extension modules find it as well. */
#include "python.h"
#include "system.h"
#include "text.h"

#include <stdlib.h>
#include <string.h>

struct python python;

static int started;

/* What a Python says of itself, a line each: its shared library (empty without one) and its executable. */
static const char *const QUESTION =
    "import os, sys, sysconfig\n"
    "get = sysconfig.get_config_var\n"
    "base = sys.base_prefix\n"
    "folders = [get('LIBDIR'), os.path.join(base, 'lib'), get('LIBPL'), get('PYTHONFRAMEWORKPREFIX'), base]\n"
    "names = [get('INSTSONAME'), get('LDLIBRARY'), 'python%d%d.dll' % sys.version_info[:2]]\n"
    "paths = [os.path.join(f, n) for f in folders for n in names if f and n and not n.endswith('.a')]\n"
    "library = next(filter(os.path.isfile, paths), '')\n"
    "os.write(1, os.fsencode(library) + b'\\n' + os.fsencode(sys.executable) + b'\\n')\n";

/* Room for the two paths of an answer. */
enum { ANSWER_SIZE = 8192 };

/* Fill the table from `library`; -1 and the missing function in `why` if it is no Python that will do. */
static int resolve(void *library, char *why, size_t size) {
#define RESOLVE(result, name, arguments)                                                                           \
    *(void **)&python.name = find_function(library, #name);                                                        \
    if (python.name == NULL) {                                                                                     \
        compose(why, size, "the Python of this process lacks the function " #name "; Python 3.11 to 3.13 will do", \
                NULL);                                                                                             \
        return -1;                                                                                                 \
    }
    PYTHON_FUNCTIONS(RESOLVE)
#undef RESOLVE
    return 0;
}

/* Load the library of the Python at `executable`. */
static int load(const char *library_path, const char *executable, char *why, size_t size) {
    if (*library_path == '\0') {
        compose(why, size, "the Python at ", executable,
                " has no shared library that a program without Python could load; install it (Debian: libpython3-dev) "
                "or set "
                "COSIM_PYTHON to another Python",
                NULL);
        return -1;
    }
    char reason[512];
    void *library = open_library(library_path, reason, sizeof reason);
    if (library == NULL) {
        compose(why, size, "the shared library of the Python at ", executable, " cannot be loaded: ", reason, NULL);
        return -1;
    }
    if (resolve(library, why, size) != 0) return -1;
    if (!python.Py_IsInitialized()) {
        /* By its executable a Python finds its packages, those of a virtual environment too. */
        void (*name)(const wchar_t *) = NULL;
        *(void **)&name = find_function(library, "Py_SetProgramName");
        wchar_t *path = wide_path(library, executable);
        if (name != NULL && path != NULL) name(path);
    }
    return 0;
}

/* Find the Python of COSIM_PYTHON, or the one on the path, for a host that has none, and load it. */
static int find(char *why, size_t size) {
    char *chosen = environment("COSIM_PYTHON"), *answer = malloc(ANSWER_SIZE);
    const char *program = chosen == NULL ? DEFAULT_PYTHON : chosen;
    int result = -1;
    if (answer == NULL || ask(program, QUESTION, answer, ANSWER_SIZE) != 0) {
        compose(why, size, "this FMU needs Python, and the command ", program,
                " does not run; set the environment variable COSIM_PYTHON to the executable of a Python with NumPy, "
                "SciPy and "
                "scikit-fem",
                NULL);
    } else {
        char *end = strchr(answer, '\n');
        char *executable = end == NULL ? answer + strlen(answer) : end + 1;
        if (end != NULL) *end = '\0';
        executable[strcspn(executable, "\n")] = '\0';
        result = load(answer, executable, why, size);
    }
    free(answer);
    free(chosen);
    return result;
}

int start_python(char *why, size_t size) {
    int result = 0;
    void *library = NULL;
    lock();
    if (!started) {
        result = process_has_python(&library) ? resolve(library, why, size) : find(why, size);
        if (result == 0) {
            if (!python.Py_IsInitialized()) {
                /* Without its signal handlers: signals belong to the host. Never finalised: NumPy could not be loaded
                 * again. */
                python.Py_InitializeEx(0);
                python.PyEval_SaveThread();
            }
            started = 1;
        }
    }
    unlock();
    return result;
}
