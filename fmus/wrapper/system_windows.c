/* See system.h: Windows. Functions whose names end in W take UTF-16, which is what Windows has of every path. */
#ifdef _WIN32
#define PSAPI_VERSION 2
#include "system.h"
#include "text.h"

#include <stdlib.h>
#include <string.h>
#include <windows.h>

#include <psapi.h>

const char *const DEFAULT_PYTHON = "python";

static SRWLOCK mutex = SRWLOCK_INIT;

/* The library has no C run-time library that would have to be started. */
BOOL WINAPI DllMainCRTStartup(HINSTANCE library, DWORD reason, LPVOID reserved) {
    (void)library, (void)reason, (void)reserved;
    return TRUE;
}

void lock(void) { AcquireSRWLockExclusive(&mutex); }

void unlock(void) { ReleaseSRWLockExclusive(&mutex); }

/* A copy in UTF-16, to be freed; NULL if it is no UTF-8. */
static wchar_t *wide(const char *text) {
    int size = MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, NULL, 0);
    wchar_t *copy = size == 0 ? NULL : malloc((size_t)size * sizeof *copy);
    if (copy != NULL) MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, copy, size);
    return copy;
}

/* A copy in UTF-8, to be freed. */
static char *narrow(const wchar_t *text) {
    int size = WideCharToMultiByte(CP_UTF8, 0, text, -1, NULL, 0, NULL, NULL);
    char *copy = size == 0 ? NULL : malloc((size_t)size);
    if (copy != NULL) WideCharToMultiByte(CP_UTF8, 0, text, -1, copy, size, NULL, NULL);
    return copy;
}

int process_has_python(void **library) {
    DWORD bytes = 0;
    if (!EnumProcessModules(GetCurrentProcess(), NULL, 0, &bytes)) return 0;
    HMODULE *modules = malloc(bytes);
    if (modules == NULL || !EnumProcessModules(GetCurrentProcess(), modules, bytes, &bytes)) bytes = 0;
    int found = 0;
    for (DWORD place = 0; !found && place < bytes / sizeof *modules; place++) {
        found = GetProcAddress(modules[place], "Py_IsInitialized") != NULL;
        if (found) *library = modules[place];
    }
    free(modules);
    return found;
}

/* What the system says of its last error, in one line. */
static void last_error(char *why, size_t size) {
    wchar_t text[256];
    DWORD flags = FORMAT_MESSAGE_FROM_SYSTEM | FORMAT_MESSAGE_IGNORE_INSERTS | FORMAT_MESSAGE_MAX_WIDTH_MASK;
    DWORD length = FormatMessageW(flags, NULL, GetLastError(), 0, text, sizeof text / sizeof *text, NULL);
    char *words = length == 0 ? NULL : narrow(text);
    compose(why, size, words == NULL ? "the system does not say why" : words, NULL);
    free(words);
}

void *open_library(const char *path, char *why, size_t size) {
    wchar_t *name = wide(path);
    /* The libraries that Python's needs lie beside it. */
    HMODULE library = name == NULL ? NULL : LoadLibraryExW(name, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
    if (library == NULL) last_error(why, size);
    free(name);
    return library;
}

void *find_function(void *library, const char *name) { return (void *)GetProcAddress(library, name); }

char *environment(const char *name) {
    wchar_t *key = wide(name);
    DWORD size = key == NULL ? 0 : GetEnvironmentVariableW(key, NULL, 0);
    wchar_t *value = size <= 1 ? NULL : malloc(size * sizeof *value);
    char *text = NULL;
    if (value != NULL && GetEnvironmentVariableW(key, value, size) == size - 1) text = narrow(value);
    free(value);
    free(key);
    return text;
}

/* The command line `"program" -c "question"`, to be freed; neither has quotation marks inside. */
static wchar_t *command_line(const char *program, const char *question) {
    size_t size = strlen(program) + strlen(question) + sizeof "\"\" -c \"\"";
    char *text = malloc(size);
    if (text == NULL) return NULL;
    compose(text, size, "\"", program, "\" -c \"", question, "\"", NULL);
    wchar_t *line = wide(text);
    free(text);
    return line;
}

int ask(const char *program, const char *question, char *answer, size_t size) {
    SECURITY_ATTRIBUTES inherited = {sizeof inherited, NULL, TRUE};
    HANDLE from = NULL, to = NULL;
    if (!CreatePipe(&from, &to, &inherited, 0)) return -1;
    SetHandleInformation(from, HANDLE_FLAG_INHERIT, 0);
    STARTUPINFOW start = {.cb = sizeof start, .dwFlags = STARTF_USESTDHANDLES};
    /* The host's own streams need not be any, or none that a child inherits. */
    HANDLE nothing = CreateFileW(L"NUL", GENERIC_READ | GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_WRITE, &inherited,
                                 OPEN_EXISTING, 0, NULL);
    start.hStdInput = nothing;
    start.hStdOutput = to;
    start.hStdError = nothing;
    PROCESS_INFORMATION child;
    wchar_t *line = command_line(program, question);
    BOOL started =
        line != NULL && CreateProcessW(NULL, line, NULL, NULL, TRUE, CREATE_NO_WINDOW, NULL, NULL, &start, &child);
    free(line);
    CloseHandle(nothing);
    CloseHandle(to);
    size_t length = 0;
    DWORD count = 0, code = 1;
    while (started && length + 1 < size && ReadFile(from, answer + length, (DWORD)(size - 1 - length), &count, NULL)) {
        length += count;
    }
    answer[length] = '\0';
    CloseHandle(from);
    if (!started) return -1;
    WaitForSingleObject(child.hProcess, INFINITE);
    GetExitCodeProcess(child.hProcess, &code);
    CloseHandle(child.hThread);
    CloseHandle(child.hProcess);
    return code == 0 ? 0 : -1;
}

wchar_t *wide_path(void *python, const char *path) {
    (void)python;
    return wide(path);
}

FILE *open_file(const char *path) {
    wchar_t *name = wide(path);
    FILE *file = name == NULL ? NULL : _wfopen(name, L"rb");
    free(name);
    return file;
}
#endif
