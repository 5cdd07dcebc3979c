/* A small FMI 2.0 importer: couples extracted FMUs by Gauss-Seidel, an output to every input of the same name.
 *
 *     host STEP_S STEPS FOLDER... [--set IDENTIFIER.PARAMETER=VALUE]... [--print OUTPUT]...
 *
 * Prints a line with the outputs asked for after the initialisation and after every step. It reads only as much of a
 * modelDescription.xml as it needs: attributes in double quotes, no entities. */
#include <ctype.h>
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"

typedef struct {
    char name[96];
    fmi2ValueReference reference;
    char type; /* R, I, S, B or E, as the element in ScalarVariable begins */
    int is_input, is_output, is_fixed;
    struct unit *source;
    fmi2ValueReference source_reference;
} Variable;

#define FUNCTIONS(X)                                                                                          \
    X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode)     \
    X(Terminate) X(DoStep) X(GetReal) X(SetReal) X(SetInteger) X(SetString)
#define POINTER(name) fmi2##name##TYPE *name;

typedef struct unit {
    char identifier[96], guid[96], location[4096];
    Variable *variables;
    size_t count;
    fmi2Component instance;
    FUNCTIONS(POINTER)
} Unit;

static void stop(const char *what, const char *which) {
    fprintf(stderr, "host: %s%s\n", what, which);
    exit(1);
}

static void check(fmi2Status status, const char *call, Unit *unit) {
    if (status <= fmi2Warning) return;
    fprintf(stderr, "host: %s of %s came back with status %d\n", call, unit->identifier, status);
    exit(1);
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    va_list arguments;
    va_start(arguments, message);
    fprintf(stderr, "%s [%s, %d]: ", instance, category, status);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

/* --- the model description ------------------------------------------------------------------------------------------ */

/* Copy the attribute `key` of the tag that begins at `tag` to `value`, "" if it has none. */
static void attribute(const char *tag, const char *key, char *value, size_t size) {
    const char *end = strchr(tag, '>');
    size_t length = strlen(key), filled = 0;
    for (const char *at = tag; at < end; at++) {
        if (!isspace((unsigned char)at[0]) || strncmp(at + 1, key, length) || strncmp(at + 1 + length, "=\"", 2)) continue;
        for (at += length + 3; *at != '"' && filled + 1 < size; at++) value[filled++] = *at;
        break;
    }
    value[filled] = '\0';
}

static char *content(const char *folder) {
    char path[4200];
    snprintf(path, sizeof path, "%s/modelDescription.xml", folder);
    FILE *file = fopen(path, "rb");
    if (file == NULL) stop("cannot read ", path);
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    char *text = malloc(size + 1);
    if (text == NULL || fread(text, 1, size, file) != (size_t)size) stop("cannot read ", path);
    text[size] = '\0';
    fclose(file);
    return text;
}

static void describe(Unit *unit, const char *folder) {
    char *text = content(folder), word[96];
    attribute(strstr(text, "<fmiModelDescription"), "guid", unit->guid, sizeof unit->guid);
    attribute(strstr(text, "<CoSimulation"), "modelIdentifier", unit->identifier, sizeof unit->identifier);
    for (char *tag = text; (tag = strstr(tag, "<ScalarVariable ")) != NULL; tag++) {
        if (unit->count % 256 == 0) {
            unit->variables = realloc(unit->variables, (unit->count + 256) * sizeof(Variable));
            if (unit->variables == NULL) stop("out of memory for the variables of ", folder);
        }
        Variable *variable = &unit->variables[unit->count++];
        memset(variable, 0, sizeof *variable);
        attribute(tag, "name", variable->name, sizeof variable->name);
        attribute(tag, "valueReference", word, sizeof word);
        variable->reference = strtoul(word, NULL, 10);
        attribute(tag, "causality", word, sizeof word);
        variable->is_input = strcmp(word, "input") == 0;
        variable->is_output = strcmp(word, "output") == 0;
        attribute(tag, "variability", word, sizeof word);
        variable->is_fixed = strcmp(word, "fixed") == 0;
        variable->type = strchr(strchr(tag, '>'), '<')[1];
    }
    free(text);
}

static Variable *find(Unit *unit, const char *name) {
    for (size_t at = 0; at < unit->count; at++)
        if (strcmp(unit->variables[at].name, name) == 0) return &unit->variables[at];
    return NULL;
}

/* --- the FMUs ------------------------------------------------------------------------------------------------------- */

static void load(Unit *unit, const char *folder) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    char path[4400];
    describe(unit, folder);
    snprintf(path, sizeof path, "%s/binaries/linux64/%s.so", folder, unit->identifier);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) stop("", dlerror());
#define RESOLVE(name)                                                                       \
    unit->name = (fmi2##name##TYPE *)dlsym(library, "fmi2" #name);                          \
    if (unit->name == NULL) stop("the FMU has no function fmi2" #name " in ", path);
    FUNCTIONS(RESOLVE)
    snprintf(unit->location, sizeof unit->location, "file://%s/resources", folder);
    unit->instance = unit->Instantiate(unit->identifier, fmi2CoSimulation, unit->guid, unit->location, &callbacks, 0, 1);
    if (unit->instance == NULL) stop("no instance of ", unit->identifier);
}

/* Give `IDENTIFIER.PARAMETER=VALUE` to the unit that is meant. */
static void set(Unit *units, size_t count, char *assignment) {
    char *dot = strchr(assignment, '.'), *equal = strchr(assignment, '=');
    if (dot == NULL || equal == NULL || equal < dot) stop("not IDENTIFIER.PARAMETER=VALUE: ", assignment);
    *dot = *equal = '\0';
    for (Unit *unit = units; unit < units + count; unit++) {
        Variable *variable = strcmp(unit->identifier, assignment) == 0 ? find(unit, dot + 1) : NULL;
        if (variable == NULL) continue;
        fmi2Real real = strtod(equal + 1, NULL);
        fmi2Integer whole = atoi(equal + 1);
        fmi2String text = equal + 1;
        if (variable->type == 'R') check(unit->SetReal(unit->instance, &variable->reference, 1, &real), "SetReal", unit);
        if (variable->type == 'I') check(unit->SetInteger(unit->instance, &variable->reference, 1, &whole), "SetInteger", unit);
        if (variable->type == 'S') check(unit->SetString(unit->instance, &variable->reference, 1, &text), "SetString", unit);
        return;
    }
    stop("no FMU takes the parameter ", dot + 1);
}

static void connect(Unit *units, size_t count) {
    for (Unit *target = units; target < units + count; target++)
        for (size_t at = 0; at < target->count; at++)
            for (Unit *source = units; target->variables[at].is_input && source < units + count; source++) {
                Variable *output = find(source, target->variables[at].name);
                if (output == NULL || !output->is_output) continue;
                target->variables[at].source = source;
                target->variables[at].source_reference = output->reference;
            }
}

/* Set the inputs of `unit` for a step, or, from the units before it, at its initialisation. */
static void feed(Unit *unit, int initially) {
    for (size_t at = 0; at < unit->count; at++) {
        Variable *input = &unit->variables[at];
        Unit *source = input->source;
        fmi2Real value;
        if (source == NULL || (initially ? source >= unit : input->is_fixed)) continue;
        check(source->GetReal(source->instance, &input->source_reference, 1, &value), "GetReal", source);
        check(unit->SetReal(unit->instance, &input->reference, 1, &value), "SetReal", unit);
    }
}

static void print(Unit *units, size_t count, char **names, size_t asked) {
    for (size_t at = 0; at < asked; at++) {
        fmi2Real value = 0.0;
        Variable *output = NULL;
        for (Unit *unit = units; unit < units + count && output == NULL; unit++) {
            output = find(unit, names[at]);
            if (output != NULL && !output->is_output) output = NULL;
            if (output != NULL) check(unit->GetReal(unit->instance, &output->reference, 1, &value), "GetReal", unit);
        }
        if (output == NULL) stop("no FMU has the output ", names[at]);
        printf("%.17g%c", value, at + 1 < asked ? ' ' : '\n');
    }
}

int main(int count, char **words) {
    if (count < 4) stop("usage: host STEP_S STEPS FOLDER... [--set X.Y=Z]... [--print OUTPUT]...", "");
    /* An FMU may crash the process when that ends; what was computed until then is not to be lost. */
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    const double step = strtod(words[1], NULL);
    const long steps = atol(words[2]);
    Unit *units = calloc(count, sizeof(Unit));
    char **names = calloc(count, sizeof(char *)), **sets = calloc(count, sizeof(char *));
    size_t number = 0, asked = 0, given = 0;
    for (int at = 3; at < count; at++) {
        if (strcmp(words[at], "--set") == 0 && at + 1 < count) sets[given++] = words[++at];
        else if (strcmp(words[at], "--print") == 0 && at + 1 < count) names[asked++] = words[++at];
        else load(&units[number++], words[at]);
    }
    for (size_t at = 0; at < given; at++) set(units, number, sets[at]);
    connect(units, number);
    for (Unit *unit = units; unit < units + number; unit++) {
        check(unit->SetupExperiment(unit->instance, fmi2False, 0.0, 0.0, fmi2False, 0.0), "SetupExperiment", unit);
        check(unit->EnterInitializationMode(unit->instance), "EnterInitializationMode", unit);
        feed(unit, 1);
        check(unit->ExitInitializationMode(unit->instance), "ExitInitializationMode", unit);
    }
    print(units, number, names, asked);
    for (long at = 0; at < steps; at++) {
        for (Unit *unit = units; unit < units + number; unit++) {
            feed(unit, 0);
            check(unit->DoStep(unit->instance, at * step, step, fmi2True), "DoStep", unit);
        }
        print(units, number, names, asked);
    }
    for (Unit *unit = units; unit < units + number; unit++) {
        check(unit->Terminate(unit->instance), "Terminate", unit);
        unit->FreeInstance(unit->instance);
    }
    return 0;
}
