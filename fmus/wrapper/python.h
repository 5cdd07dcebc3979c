/* The Python that the wrapper works with, found at run time: the host's own, or one loaded into a host without.
 *
 * Only functions of Python's stable ABI are used, and none is linked: an FMU loads in any process, and one binary
 * serves every version of Python that the project does. */
#ifndef COSIM_WRAPPER_PYTHON_H
#define COSIM_WRAPPER_PYTHON_H

#include <stddef.h>

typedef struct object PyObject;
typedef ptrdiff_t Py_ssize_t;

enum { VIEW_READ = 0x100, VIEW_WRITE = 0x200, FILE_INPUT = 257 };

/* Each function under the name that Python gives it. */
#define PYTHON_FUNCTIONS(X)                                                           \
    X(int, Py_IsInitialized, (void))                                                  \
    X(void, Py_InitializeEx, (int signals))                                           \
    X(void, Py_DecRef, (PyObject *))                                                  \
    X(void *, PyEval_SaveThread, (void))                                              \
    X(void, PyEval_RestoreThread, (void *))                                           \
    X(int, PyGILState_Ensure, (void))                                                 \
    X(void, PyGILState_Release, (int))                                                \
    X(void, PyErr_Fetch, (PyObject **, PyObject **, PyObject **))                     \
    X(void, PyErr_NormalizeException, (PyObject **, PyObject **, PyObject **))        \
    X(PyObject *, PyErr_Occurred, (void))                                             \
    X(PyObject *, PyObject_Str, (PyObject *))                                         \
    X(const char *, PyUnicode_AsUTF8AndSize, (PyObject *, Py_ssize_t *))              \
    X(PyObject *, PyUnicode_DecodeUTF8, (const char *, Py_ssize_t, const char *))     \
    X(PyObject *, PyObject_CallMethod, (PyObject *, const char *, const char *, ...)) \
    X(PyObject *, PyObject_CallFunction, (PyObject *, const char *, ...))             \
    X(PyObject *, PyMemoryView_FromMemory, (char *, Py_ssize_t, int))                 \
    X(PyObject *, PyTuple_GetItem, (PyObject *, Py_ssize_t))                          \
    X(PyObject *, PyList_New, (Py_ssize_t))                                           \
    X(int, PyList_Append, (PyObject *, PyObject *))                                   \
    X(PyObject *, PyList_GetItem, (PyObject *, Py_ssize_t))                           \
    X(Py_ssize_t, PyList_Size, (PyObject *))                                          \
    X(long, PyLong_AsLong, (PyObject *))                                              \
    X(double, PyFloat_AsDouble, (PyObject *))                                         \
    X(PyObject *, PyBytes_FromStringAndSize, (const char *, Py_ssize_t))              \
    X(int, PyBytes_AsStringAndSize, (PyObject *, char **, Py_ssize_t *))              \
    X(PyObject *, PyDict_New, (void))                                                 \
    X(int, PyDict_SetItemString, (PyObject *, const char *, PyObject *))              \
    X(PyObject *, PyDict_GetItemString, (PyObject *, const char *))                   \
    X(PyObject *, PyEval_GetBuiltins, (void))                                         \
    X(PyObject *, Py_CompileString, (const char *, const char *, int))                \
    X(PyObject *, PyEval_EvalCode, (PyObject *, PyObject *, PyObject *))              \
    X(void, Py_IncRef, (PyObject *))

struct python {
#define DECLARE(result, name, arguments) result(*name) arguments;
    PYTHON_FUNCTIONS(DECLARE)
#undef DECLARE
};

/* Python's functions, once `start_python` has succeeded. */
extern struct python python;

/* Make Python ready to be called: once per process is enough, again does no harm. Returns 0, or -1 with the reason and
 * the remedy in `why`. */
int start_python(char *why, size_t size);

#endif
