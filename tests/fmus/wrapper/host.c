/* A host for the wrapper of either version of FMI, against the headers of the standard: it does what the words of its
 * command line say, and prints the status of each call and what it gave. Links no Python.
 *
 *     host LIBRARY VERSION LOCATION TOKEN WORD...          a word is a name and its arguments, name:argument:argument
 */
#include "fmi2Functions.h"
#include "fmi3Functions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static HMODULE library;
static void *find(const char *name) { return (void *)GetProcAddress(library, name); }
static int open_library(const char *path) { return (library = LoadLibraryA(path)) != NULL; }
static const char *load_error(void) { return "LoadLibrary"; }
#else
#include <dlfcn.h>
static void *library;
static void *find(const char *name) { return dlsym(library, name); }
static int open_library(const char *path) { return (library = dlopen(path, RTLD_NOW | RTLD_LOCAL)) != NULL; }
static const char *load_error(void) { return dlerror(); }
#endif

/* The library's function `name`, of the type that the standard gives it. */
#define F(name) ((name##TYPE *)symbol(#name))

enum { MANY = 64 };

static int version, logging, announced = 2;
static const char *location, *token;
static void *instance, *state;
static char *bytes;
static size_t bytes_count;
/* What the host does when it is asked for intermediate values: words as on the command line, `+` between them. */
static const char *on_update = "";
static const unsigned required[] = {1, 2, 98};

static int run(char *word);

static void *symbol(const char *name) {
    void *function = find(name);
    if (function == NULL) {
        printf("%s is missing\n", name);
        exit(1);
    }
    return function;
}

/* --- callbacks -------------------------------------------------------------------------------------------------- */

static void tell2(fmi2ComponentEnvironment where, fmi2String name, fmi2Status status, fmi2String category,
                  fmi2String text, ...) {
    /* As every host in C does: the message is a format. */
    printf("log %d %s %s: ", status, category, name);
    printf(text, where);
    printf("\n");
}

static fmi2CallbackFunctions callbacks = {tell2, calloc, free, NULL, NULL};

static void tell3(fmi3InstanceEnvironment where, fmi3Status status, fmi3String category, fmi3String text) {
    printf("log %d %s %s: %s\n", status, category, where == NULL ? "-" : (const char *)where, text);
}

static void update3(fmi3InstanceEnvironment where, fmi3Float64 time, fmi3Boolean set, fmi3Boolean get,
                    fmi3Boolean finished, fmi3Boolean can_return, fmi3Boolean *early, fmi3Float64 *early_time) {
    (void)where, (void)early_time;
    *early = fmi3True; /* which the wrapper has not offered */
    if (callbacks.logger != NULL) {
        printf("update %g set=%d get=%d finished=%d early=%d\n", time, set, get, finished, can_return);
    }
    char words[256];
    strcpy(words, on_update);
    for (char *word = words, *next; *word != '\0'; word = next) {
        next = word + strcspn(word, "+");
        if (*next != '\0') *next++ = '\0';
        run(word);
    }
}

/* --- helpers ---------------------------------------------------------------------------------------------------- */

static size_t numbers_in(char *text, double *numbers) {
    size_t count = 0;
    for (char *end; text != NULL && *text != '\0'; text = *end == ',' ? end + 1 : end)
        numbers[count++] = strtod(text, &end);
    return count;
}

static size_t references_in(char *text, unsigned *references) {
    double numbers[MANY];
    size_t count = numbers_in(text, numbers);
    for (size_t place = 0; place < count; place++) references[place] = (unsigned)numbers[place];
    return count;
}

static void show(const double *values, size_t count) {
    for (size_t place = 0; place < count; place++) printf(" %g", values[place]);
}

static void *new_instance(void) {
    fmi3LogMessageCallback logger = callbacks.logger == tell2 ? tell3 : NULL;
    if (version == 2) return F(fmi2Instantiate)("two", fmi2CoSimulation, token, location, &callbacks, 0, logging);
    return F(fmi3InstantiateCoSimulation)("three", token, location, 0, logging, 0, 1, required, (size_t)announced,
                                          (void *)"env", logger, update3);
}

static void free_instance(void) {
    if (version == 2) {
        F(fmi2FreeInstance)(instance);
    } else {
        F(fmi3FreeInstance)(instance);
    }
    instance = NULL;
}

/* --- values ----------------------------------------------------------------------------------------------------- */

#define TRY2(kind)                                                                              \
    if (version == 2 && strcmp(type, #kind) == 0) {                                             \
        fmi2##kind items[MANY];                                                                 \
        for (size_t place = 0; place < MANY; place++) items[place] = (fmi2##kind)values[place]; \
        status = setting ? F(fmi2Set##kind)(instance, references, count, items)                 \
                         : F(fmi2Get##kind)(instance, references, count, items);                \
        for (size_t place = 0; place < MANY; place++) values[place] = (double)items[place];     \
    }

#define TRY3(kind)                                                                              \
    if (version == 3 && strcmp(type, #kind) == 0) {                                             \
        fmi3##kind items[MANY];                                                                 \
        for (size_t place = 0; place < MANY; place++) items[place] = (fmi3##kind)values[place]; \
        status = setting ? F(fmi3Set##kind)(instance, references, count, items, values_count)   \
                         : F(fmi3Get##kind)(instance, references, count, items, values_count);  \
        for (size_t place = 0; place < MANY; place++) values[place] = (double)items[place];     \
    }

static int move(int setting, const char *type, char *words, double *values, size_t values_count) {
    unsigned references[MANY];
    size_t count = references_in(words, references);
    int status = -1;
    TRY2(Real)
    TRY2(Integer)
    TRY2(Boolean)
    TRY3(Float64)
    TRY3(Float32) TRY3(Int8) TRY3(UInt8) TRY3(Int16) TRY3(UInt16) TRY3(Int32) TRY3(UInt32) TRY3(Int64) TRY3(UInt64)
        TRY3(Boolean) return status;
}

static int texts(int setting, char *words, char *given) {
    unsigned references[MANY];
    const char *values[MANY];
    size_t count = references_in(words, references);
    for (size_t place = 0; place < count; place++) values[place] = strcmp(given, "NULL") == 0 ? NULL : given;
    int status;
    if (version == 2) {
        status = setting ? F(fmi2SetString)(instance, references, count, values)
                         : F(fmi2GetString)(instance, references, count, values);
    } else {
        status = setting ? F(fmi3SetString)(instance, references, count, values, count)
                         : F(fmi3GetString)(instance, references, count, values, count);
    }
    printf("%s %d", setting ? "sets" : "gets", status);
    for (size_t place = 0; !setting && status <= 1 && place < count; place++) printf(" '%s'", values[place]);
    printf("\n");
    return status;
}

/* --- states ----------------------------------------------------------------------------------------------------- */

static int save(void) {
    return version == 2 ? (int)F(fmi2GetFMUstate)(instance, &state) : (int)F(fmi3GetFMUState)(instance, &state);
}

static int restore(void) {
    return version == 2 ? (int)F(fmi2SetFMUstate)(instance, state) : (int)F(fmi3SetFMUState)(instance, state);
}

static int drop(void) {
    return version == 2 ? (int)F(fmi2FreeFMUstate)(instance, &state) : (int)F(fmi3FreeFMUState)(instance, &state);
}

static int pack(int missing) {
    int status = version == 2 ? (int)F(fmi2SerializedFMUstateSize)(instance, state, &bytes_count)
                              : (int)F(fmi3SerializedFMUStateSize)(instance, state, &bytes_count);
    if (status > 1) return status;
    bytes = realloc(bytes, bytes_count);
    bytes_count -= (size_t)missing;
    return version == 2 ? (int)F(fmi2SerializeFMUstate)(instance, state, bytes, bytes_count)
                        : (int)F(fmi3SerializeFMUState)(instance, state, (fmi3Byte *)bytes, bytes_count);
}

static int unpack(size_t count) {
    return version == 2 ? (int)F(fmi2DeSerializeFMUstate)(instance, bytes, count, &state)
                        : (int)F(fmi3DeserializeFMUState)(instance, (fmi3Byte *)bytes, count, &state);
}

/* --- life ------------------------------------------------------------------------------------------------------- */

static int start(double time, const char *stop) {
    int given = *stop != '\0';
    if (version == 3) return F(fmi3EnterInitializationMode)(instance, 0, 0.0, time, given, atof(stop));
    int status = F(fmi2SetupExperiment)(instance, 0, 0.0, time, given, atof(stop));
    return status > 1 ? status : (int)F(fmi2EnterInitializationMode)(instance);
}

static int step(double time, double size) {
    if (version == 2) {
        double last = NAN;
        int status = F(fmi2DoStep)(instance, time, size, 1);
        int told = F(fmi2GetRealStatus)(instance, fmi2LastSuccessfulTime, &last);
        printf("step %d time %d %g\n", status, told, last);
        return status;
    }
    fmi3Boolean events = 1, end = 1, early = 1;
    double last = NAN;
    int status = F(fmi3DoStep)(instance, time, size, 1, &events, &end, &early, &last);
    printf("step %d time %g events=%d end=%d early=%d\n", status, last, events, end, early);
    return status;
}

static int derivative(int adjoint) {
    unsigned unknown = 5, known = 6;
    double seed = 1.5, result = NAN;
    int status;
    if (version == 2) {
        status = F(fmi2GetDirectionalDerivative)(instance, &unknown, 1, &known, 1, &seed, &result);
    } else if (adjoint) {
        status = F(fmi3GetAdjointDerivative)(instance, &unknown, 1, &known, 1, &seed, 1, &result, 1);
    } else {
        status = F(fmi3GetDirectionalDerivative)(instance, &unknown, 1, &known, 1, &seed, 1, &result, 1);
    }
    printf("derivative %d %g\n", status, result);
    return status;
}

static int rates(void) {
    unsigned references[] = {1, 2};
    int orders[] = {1, 1};
    double values[] = {0.5, -0.5};
    return F(fmi2SetRealInputDerivatives)(instance, references, 2, orders, values);
}

static int categories(int enabled, char *words) {
    const char *names[MANY];
    size_t count = 0;
    for (char *word = words, *next; word != NULL && *word != '\0'; word = next) {
        next = word + strcspn(word, ",");
        if (*next != '\0') *next++ = '\0';
        names[count++] = strcmp(word, "NULL") == 0 ? NULL : word;
    }
    return version == 2 ? (int)F(fmi2SetDebugLogging)(instance, enabled, count, count == 0 ? NULL : names)
                        : (int)F(fmi3SetDebugLogging)(instance, enabled, count, count == 0 ? NULL : names);
}

/* --- what a host should not do ---------------------------------------------------------------------------------- */

/* A function with the instance, or none, and zeros for all that follows: in the calling conventions of all platforms
 * those are NULL pointers, counts of nothing, and false. */
static int bare(const char *name, void *with) {
    typedef int Function(void *, void *, void *, void *, void *, void *, void *, void *, void *, void *, void *);
    return ((Function *)symbol(name))(with, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL);
}

#define SAY(call) printf("%s %d\n", #call, (int)(call))

/* Arrays that are said to have items and are NULL, or longer than memory. */
static void nulls(void) {
    unsigned r[3] = {1, 2, 3};
    double x[3] = {0};
    int n[3] = {0};
    size_t size = 0;
    size_t endless = (size_t)-1 / 2;
    if (version == 2) {
        SAY(F(fmi2GetReal)(instance, NULL, 3, x));
        SAY(F(fmi2GetReal)(instance, r, 3, NULL));
        SAY(F(fmi2SetReal)(instance, r, endless, x));
        SAY(F(fmi2SetInteger)(instance, r, 3, NULL));
        SAY(F(fmi2GetBoolean)(instance, NULL, 3, n));
        SAY(F(fmi2GetString)(instance, r, 3, NULL));
        SAY(F(fmi2SetString)(instance, NULL, 3, NULL));
        SAY(F(fmi2SetRealInputDerivatives)(instance, r, 3, NULL, x));
        SAY(F(fmi2SetRealInputDerivatives)(instance, r, 3, n, NULL));
        SAY(F(fmi2GetDirectionalDerivative)(instance, r, 3, NULL, 3, x, x));
        SAY(F(fmi2GetDirectionalDerivative)(instance, r, 3, r, 3, x, NULL));
        SAY(F(fmi2GetFMUstate)(instance, NULL));
        SAY(F(fmi2SetFMUstate)(instance, NULL));
        SAY(F(fmi2FreeFMUstate)(instance, NULL));
        SAY(F(fmi2SerializedFMUstateSize)(instance, NULL, &size));
        SAY(F(fmi2SerializeFMUstate)(instance, NULL, (char *)x, 3));
        SAY(F(fmi2DeSerializeFMUstate)(instance, NULL, 3, &state));
        SAY(F(fmi2DeSerializeFMUstate)(instance, (char *)x, 3, NULL));
        SAY(F(fmi2GetRealStatus)(instance, fmi2LastSuccessfulTime, NULL));
        SAY(F(fmi2GetBooleanStatus)(instance, fmi2Terminated, NULL));
        SAY(F(fmi2SetDebugLogging)(instance, 1, 2, NULL));
        SAY(F(fmi2Instantiate)("x", fmi2CoSimulation, token, location, NULL, 0, 0) != NULL);
        SAY(F(fmi2Instantiate)(NULL, fmi2CoSimulation, token, location, &callbacks, 0, 0) != NULL);
        SAY(F(fmi2Instantiate)("", fmi2CoSimulation, token, location, &callbacks, 0, 0) != NULL);
        SAY(F(fmi2Instantiate)("x", fmi2CoSimulation, NULL, location, &callbacks, 0, 0) != NULL);
        SAY(F(fmi2Instantiate)("x", fmi2CoSimulation, token, NULL, &callbacks, 0, 0) != NULL);
        SAY(F(fmi2Instantiate)("x", fmi2ModelExchange, token, location, &callbacks, 0, 0) != NULL);
        return;
    }
    fmi3Boolean yes = fmi3True;
    SAY(F(fmi3GetFloat64)(instance, NULL, 3, x, 3));
    SAY(F(fmi3GetFloat64)(instance, r, 3, NULL, 3));
    SAY(F(fmi3SetFloat64)(instance, r, 3, NULL, 3));
    SAY(F(fmi3SetFloat64)(instance, r, 3, x, endless));
    SAY(F(fmi3SetFloat64)(instance, r, endless, x, 3));
    SAY(F(fmi3GetInt8)(instance, r, 3, NULL, 3));
    SAY(F(fmi3SetBoolean)(instance, NULL, 3, &yes, 1));
    SAY(F(fmi3GetString)(instance, r, 3, NULL, 3));
    SAY(F(fmi3SetString)(instance, NULL, 3, NULL, 3));
    SAY(F(fmi3GetBinary)(instance, NULL, 3, NULL, NULL, 0));
    SAY(F(fmi3SetClock)(instance, NULL, 3, &yes));
    SAY(F(fmi3GetDirectionalDerivative)(instance, r, 3, r, 3, NULL, 3, x, 3));
    SAY(F(fmi3GetAdjointDerivative)(instance, r, 3, r, 3, x, 3, NULL, 3));
    SAY(F(fmi3GetFMUState)(instance, NULL));
    SAY(F(fmi3SetFMUState)(instance, NULL));
    SAY(F(fmi3FreeFMUState)(instance, NULL));
    SAY(F(fmi3SerializedFMUStateSize)(instance, NULL, &size));
    SAY(F(fmi3SerializeFMUState)(instance, NULL, (fmi3Byte *)x, 3));
    SAY(F(fmi3DeserializeFMUState)(instance, NULL, 3, &state));
    SAY(F(fmi3DeserializeFMUState)(instance, (fmi3Byte *)x, 3, NULL));
    SAY(F(fmi3SetDebugLogging)(instance, yes, 2, NULL));
    SAY(F(fmi3DoStep)(instance, 0.0, 0.5, yes, NULL, NULL, NULL, NULL) > 1);
    fmi3InstantiateCoSimulationTYPE *make = F(fmi3InstantiateCoSimulation);
    SAY(make(NULL, token, location, 0, 0, 0, 0, NULL, 0, NULL, tell3, NULL) != NULL);
    SAY(make("x", NULL, location, 0, 0, 0, 0, NULL, 0, NULL, tell3, NULL) != NULL);
    SAY(make("x", token, NULL, 0, 0, 0, 0, NULL, 0, NULL, tell3, NULL) != NULL);
    SAY(make("x", token, location, 0, 0, 0, 0, NULL, 3, NULL, tell3, NULL) != NULL);
    SAY(make("x", token, location, 0, 0, yes, 0, NULL, 0, NULL, tell3, NULL) != NULL);
    SAY(make("x", "wrong", location, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL) != NULL);
    SAY(F(fmi3InstantiateModelExchange)("x", token, location, 0, 0, NULL, tell3) != NULL);
    SAY(F(fmi3InstantiateScheduledExecution)("x", token, location, 0, 0, NULL, tell3, NULL, NULL, NULL) != NULL);
}

/* --- a long life ------------------------------------------------------------------------------------------------ */

/* What this process has in memory, in kB; 0 where nobody knows. */
static long memory(void) {
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file == NULL || fscanf(file, "%*d %ld", &pages) != 1) pages = 0;
    if (file != NULL) fclose(file);
    return 4 * pages;
}

/* Instances that roll back, fail and are given up, some with a state that nobody frees, `count` times. */
static void lives(int count) {
    for (int turn = 0; turn < count; turn++) {
        double values[MANY] = {1.0, 2.0, 3.0};
        char first[] = "1,2,3", wrong[] = "99", raises[] = "98";
        instance = new_instance();
        if (instance == NULL) exit(1);
        start(0.0, "");
        move(1, version == 2 ? "Real" : "Float64", first, values, 3);
        state = NULL;
        if (save() + save() + restore() + pack(0) + unpack(bytes_count) != 0) exit(1);
        move(1, version == 2 ? "Real" : "Float64", wrong, values, 1);
        move(0, version == 2 ? "Real" : "Float64", raises, values, 1);
        if (version == 2) {
            F(fmi2DoStep)(instance, 0.0, 0.5, 1);
        } else {
            F(fmi3DoStep)(instance, 0.0, 0.5, 1, NULL, NULL, NULL, NULL);
        }
        unpack(3);
        restore();
        if (turn % 2 == 0) drop();
        free_instance();
    }
}

/* --- words ------------------------------------------------------------------------------------------------------ */

static void report(const char *name, int status) { printf("%s %d\n", name, status); }

static int run(char *word) {
    char *a[4] = {word, "", "", ""};
    for (int place = 1; place < 4 && (a[place] = strchr(a[place - 1], ':')) != NULL; place++) *a[place]++ = '\0';
    for (int place = 1; place < 4; place++) a[place] = a[place] == NULL ? "" : a[place];
    double values[MANY] = {0};
    if (strcmp(word, "loud") == 0) {
        logging = 1;
    } else if (strcmp(word, "mute") == 0) {
        callbacks.logger = NULL;
    } else if (strcmp(word, "announce") == 0) {
        announced = atoi(a[1]);
    } else if (strcmp(word, "on_update") == 0) {
        static char kept[256];
        snprintf(kept, sizeof kept, "%s%s%s%s%s", a[1], *a[2] ? ":" : "", a[2], *a[3] ? ":" : "", a[3]);
        on_update = kept;
    } else if (strcmp(word, "new") == 0) {
        instance = new_instance();
        report("new", instance != NULL);
    } else if (strcmp(word, "free") == 0) {
        void *before = instance;
        free_instance();
        if (*a[1] != '\0') instance = before; /* it is refused */
    } else if (strcmp(word, "start") == 0) {
        report("start", start(atof(a[1]), a[2]));
    } else if (strcmp(word, "exit") == 0) {
        report("exit", version == 2 ? (int)F(fmi2ExitInitializationMode)(instance)
                                    : (int)F(fmi3ExitInitializationMode)(instance));
    } else if (strcmp(word, "end") == 0) {
        report("end", version == 2 ? (int)F(fmi2Terminate)(instance) : (int)F(fmi3Terminate)(instance));
    } else if (strcmp(word, "reset") == 0) {
        report("reset", version == 2 ? (int)F(fmi2Reset)(instance) : (int)F(fmi3Reset)(instance));
    } else if (strcmp(word, "step") == 0) {
        step(atof(a[1]), atof(a[2]));
    } else if (strcmp(word, "set") == 0) {
        size_t count = numbers_in(a[3], values);
        report("set", move(1, a[1], a[2], values, count));
    } else if (strcmp(word, "get") == 0) {
        size_t count = (size_t)atoi(a[3]);
        printf("get %d", move(0, a[1], a[2], values, count));
        show(values, count);
        printf("\n");
    } else if (strcmp(word, "gets") == 0 || strcmp(word, "sets") == 0) {
        texts(*word == 's', a[1], a[2]);
    } else if (strcmp(word, "save") == 0) {
        report("save", save());
    } else if (strcmp(word, "restore") == 0) {
        report("restore", restore());
    } else if (strcmp(word, "drop") == 0) {
        report("drop", drop());
        if (state != NULL) printf("there is a state left\n");
    } else if (strcmp(word, "garbage") == 0) {
        state = &state;
    } else if (strcmp(word, "pack") == 0) {
        report("pack", pack(atoi(a[1])));
    } else if (strcmp(word, "unpack") == 0) {
        report("unpack", unpack(*a[1] == '\0' ? bytes_count : (size_t)atoi(a[1])));
    } else if (strcmp(word, "forward") == 0 || strcmp(word, "adjoint") == 0) {
        derivative(*word == 'a');
    } else if (strcmp(word, "rates") == 0) {
        report("rates", rates());
    } else if (strcmp(word, "log") == 0) {
        report("log", categories(strcmp(a[1], "on") == 0, a[2]));
    } else if (strcmp(word, "call") == 0) {
        report(a[1], bare(a[1], instance));
    } else if (strcmp(word, "void") == 0) {
        report(a[1], bare(a[1], NULL));
    } else if (strcmp(word, "nulls") == 0) {
        nulls();
    } else if (strcmp(word, "version") == 0) {
        printf("version %s\n", version == 2 ? F(fmi2GetVersion)() : F(fmi3GetVersion)());
    } else if (strcmp(word, "lives") == 0) {
        lives(atoi(a[1]));
        fprintf(stderr, "memory %ld\n", memory());
    } else if (strcmp(word, "alive") == 0) {
        char reference[] = "90";
        instance = new_instance();
        move(0, version == 2 ? "Real" : "Float64", reference, values, 1);
        free_instance();
        fprintf(stderr, "alive %g\n", values[0]);
    } else {
        printf("what is %s?\n", word);
        return 1;
    }
    return 0;
}

int main(int count, char **words) {
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    if (count < 5 || !open_library(words[1])) {
        printf("the library cannot be loaded: %s\n", load_error());
        return 1;
    }
    version = atoi(words[2]);
    location = words[3];
    token = words[4];
    for (int place = 5; place < count; place++) {
        if (run(words[place]) != 0) return 1;
    }
    free(bytes);
    return 0;
}
