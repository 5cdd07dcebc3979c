/* A small importer of FMI 2.0 and 3.0: couples extracted FMUs by Gauss-Seidel, an output to every input of the same name.
 *
 *     host STEP_S STEPS FOLDER... [--set IDENTIFIER.PARAMETER=VALUE]... [--print OUTPUT]...
 *
 * Prints a line with the outputs asked for after the initialisation and after every step. It reads only as much of a
 * modelDescription.xml as it needs: attributes in double quotes, no entities. What the two versions call differently is
 * below `the calls`; a variable of FMI 2.0 is one of FMI 3.0 with a single value. */
#include <ctype.h>
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"
#include "fmi3Functions.h"

typedef struct {
    char name[96];
    unsigned int reference;
    char type[16]; /* Real, Integer or String in FMI 2.0, Float64, Int32 or String in FMI 3.0, or another */
    size_t size;
    int is_input, is_output;
    double *values;
    struct unit *source;
    size_t source_place;
} Variable;

#define FUNCTIONS2(X)                                                                                      \
    X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode) X(ExitInitializationMode) \
    X(Terminate) X(DoStep) X(GetReal) X(SetReal) X(SetInteger) X(SetString)
#define FUNCTIONS3(X)                                                                                        \
    X(InstantiateCoSimulation) X(FreeInstance) X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) \
    X(DoStep) X(GetFloat64) X(SetFloat64) X(SetInt32) X(SetString)
#define POINTER2(name) fmi2##name##TYPE *name;
#define POINTER3(name) fmi3##name##TYPE *name;

typedef struct unit {
    int fmi;
    char identifier[96], token[96], folder[4096];
    Variable *variables;
    size_t count;
    void *instance;
    struct { FUNCTIONS2(POINTER2) } two;
    struct { FUNCTIONS3(POINTER3) } three;
} Unit;

static void stop(const char *what, const char *which) {
    fprintf(stderr, "host: %s%s\n", what, which);
    exit(1);
}

static void check(int status, const char *call, Unit *unit) {
    if (status <= fmi2Warning) return;
    fprintf(stderr, "host: %s of %s came back with status %d\n", call, unit->identifier, status);
    exit(1);
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

/* Whether the tag at `tag` is an element of this name. */
static int is(const char *tag, const char *name) {
    size_t length = strlen(name);
    return strncmp(tag + 1, name, length) == 0 && strchr(" \n\t/>", tag[1 + length]) != NULL;
}

static Variable *add(Unit *unit, const char *tag) {
    char word[96];
    if (unit->count % 256 == 0) {
        unit->variables = realloc(unit->variables, (unit->count + 256) * sizeof(Variable));
        if (unit->variables == NULL) stop("out of memory for the variables of ", unit->folder);
    }
    Variable *variable = &unit->variables[unit->count++];
    memset(variable, 0, sizeof *variable);
    variable->size = 1;
    attribute(tag, "name", variable->name, sizeof variable->name);
    attribute(tag, "valueReference", word, sizeof word);
    variable->reference = strtoul(word, NULL, 10);
    attribute(tag, "causality", word, sizeof word);
    variable->is_input = strcmp(word, "input") == 0;
    variable->is_output = strcmp(word, "output") == 0;
    return variable;
}

static void describe(Unit *unit) {
    static const char *const types[] = {"Real", "Integer", "Float64", "Int32", "String"};
    char *text = content(unit->folder), word[96];
    const char *root = strstr(text, "<fmiModelDescription");
    attribute(root, "fmiVersion", word, sizeof word);
    unit->fmi = word[0] - '0';
    attribute(root, unit->fmi == 2 ? "guid" : "instantiationToken", unit->token, sizeof unit->token);
    attribute(strstr(text, "<CoSimulation"), "modelIdentifier", unit->identifier, sizeof unit->identifier);
    Variable *variable = NULL;
    const char *end = strstr(text, "</ModelVariables>");
    for (const char *tag = strstr(text, "<ModelVariables"); (tag = strchr(tag + 1, '<')) < end;) {
        if (is(tag, "ScalarVariable")) variable = add(unit, tag);
        if (is(tag, "Dimension")) {
            attribute(tag, "start", word, sizeof word);
            variable->size *= strtoul(word, NULL, 10);
        }
        for (size_t at = 0; at < sizeof types / sizeof *types; at++) {
            if (!is(tag, types[at])) continue;
            if (unit->fmi == 3) variable = add(unit, tag);
            snprintf(variable->type, sizeof variable->type, "%s", types[at]);
        }
    }
    for (variable = unit->variables; variable < unit->variables + unit->count; variable++) {
        variable->values = calloc(variable->size, sizeof(double));
        if (variable->values == NULL) stop("out of memory for the values of ", variable->name);
    }
    free(text);
}

static Variable *find(Unit *unit, const char *name) {
    for (size_t at = 0; at < unit->count; at++)
        if (strcmp(unit->variables[at].name, name) == 0) return &unit->variables[at];
    return NULL;
}

/* --- the calls ------------------------------------------------------------------------------------------------------ */

static void logger2(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                    fmi2String message, ...) {
    (void)environment;
    va_list arguments;
    va_start(arguments, message);
    fprintf(stderr, "%s [%s, %d]: ", instance, category, status);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void logger3(fmi3InstanceEnvironment unit, fmi3Status status, fmi3String category, fmi3String message) {
    fprintf(stderr, "%s [%s, %d]: %s\n", ((Unit *)unit)->identifier, category, status, message);
}

static void load(Unit *unit, const char *folder) {
    static const fmi2CallbackFunctions callbacks = {logger2, calloc, free, NULL, NULL};
    char path[4400];
    snprintf(unit->folder, sizeof unit->folder, "%s", folder);
    describe(unit);
    const char *platform = unit->fmi == 2 ? "linux64" : "x86_64-linux";
    snprintf(path, sizeof path, "%s/binaries/%s/%s.so", folder, platform, unit->identifier);
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) stop("", dlerror());
#define RESOLVE(version, member, name)                                                            \
    unit->member.name = (fmi##version##name##TYPE *)dlsym(library, "fmi" #version #name);         \
    if (unit->member.name == NULL) stop("the FMU has no function fmi" #version #name " in ", path);
#define RESOLVE2(name) RESOLVE(2, two, name)
#define RESOLVE3(name) RESOLVE(3, three, name)
    if (unit->fmi == 2) {
        FUNCTIONS2(RESOLVE2)
        snprintf(path, sizeof path, "file://%s/resources", folder);
        unit->instance = unit->two.Instantiate(unit->identifier, fmi2CoSimulation, unit->token, path, &callbacks, 0, 1);
    } else {
        FUNCTIONS3(RESOLVE3)
        snprintf(path, sizeof path, "%s/resources/", folder);
        unit->instance = unit->three.InstantiateCoSimulation(unit->identifier, unit->token, path, fmi3False, fmi3True,
                                                             fmi3False, fmi3False, NULL, 0, unit, logger3, NULL);
    }
    if (unit->instance == NULL) stop("no instance of ", unit->identifier);
}

/* Read an output into its values. */
static void get(Unit *unit, Variable *output) {
    if (unit->fmi == 2) check(unit->two.GetReal(unit->instance, &output->reference, 1, output->values), "GetReal", unit);
    else check(unit->three.GetFloat64(unit->instance, &output->reference, 1, output->values, output->size), "GetFloat64", unit);
}

/* Set an input, or a real parameter, to `values`. */
static void set(Unit *unit, Variable *input, const double *values) {
    if (unit->fmi == 2) check(unit->two.SetReal(unit->instance, &input->reference, 1, values), "SetReal", unit);
    else check(unit->three.SetFloat64(unit->instance, &input->reference, 1, values, input->size), "SetFloat64", unit);
}

static void set_whole(Unit *unit, Variable *variable, int value) {
    if (unit->fmi == 2) check(unit->two.SetInteger(unit->instance, &variable->reference, 1, &value), "SetInteger", unit);
    else check(unit->three.SetInt32(unit->instance, &variable->reference, 1, &value, 1), "SetInt32", unit);
}

static void set_text(Unit *unit, Variable *variable, const char *value) {
    if (unit->fmi == 2) check(unit->two.SetString(unit->instance, &variable->reference, 1, &value), "SetString", unit);
    else check(unit->three.SetString(unit->instance, &variable->reference, 1, &value, 1), "SetString", unit);
}

static void begin(Unit *unit) {
    if (unit->fmi == 2) {
        check(unit->two.SetupExperiment(unit->instance, fmi2False, 0.0, 0.0, fmi2False, 0.0), "SetupExperiment", unit);
        check(unit->two.EnterInitializationMode(unit->instance), "EnterInitializationMode", unit);
    } else {
        check(unit->three.EnterInitializationMode(unit->instance, fmi3False, 0.0, 0.0, fmi3False, 0.0),
              "EnterInitializationMode", unit);
    }
}

static void complete(Unit *unit) {
    int status = unit->fmi == 2 ? (int)unit->two.ExitInitializationMode(unit->instance)
                                : (int)unit->three.ExitInitializationMode(unit->instance);
    check(status, "ExitInitializationMode", unit);
}

static void advance(Unit *unit, double time, double step) {
    if (unit->fmi == 2) {
        check(unit->two.DoStep(unit->instance, time, step, fmi2True), "DoStep", unit);
    } else {
        fmi3Boolean event, end, early;
        fmi3Float64 reached;
        check(unit->three.DoStep(unit->instance, time, step, fmi3True, &event, &end, &early, &reached), "DoStep", unit);
        if (event || end || early || reached != time + step) stop("another end of a step than was asked for in ", unit->identifier);
    }
}

static void finish(Unit *unit) {
    if (unit->fmi == 2) {
        check(unit->two.Terminate(unit->instance), "Terminate", unit);
        unit->two.FreeInstance(unit->instance);
    } else {
        check(unit->three.Terminate(unit->instance), "Terminate", unit);
        unit->three.FreeInstance(unit->instance);
    }
    for (size_t at = 0; at < unit->count; at++) free(unit->variables[at].values);
    free(unit->variables);
}

/* --- coupling ------------------------------------------------------------------------------------------------------- */

/* Give `IDENTIFIER.PARAMETER=VALUE` to the unit that is meant. */
static void assign(Unit *units, size_t count, char *assignment) {
    char *dot = strchr(assignment, '.'), *equal = strchr(assignment, '=');
    if (dot == NULL || equal == NULL || equal < dot) stop("not IDENTIFIER.PARAMETER=VALUE: ", assignment);
    *dot = *equal = '\0';
    for (Unit *unit = units; unit < units + count; unit++) {
        Variable *variable = strcmp(unit->identifier, assignment) == 0 ? find(unit, dot + 1) : NULL;
        if (variable == NULL) continue;
        double real = strtod(equal + 1, NULL);
        if (strcmp(variable->type, "Real") == 0 || strcmp(variable->type, "Float64") == 0) set(unit, variable, &real);
        else if (strcmp(variable->type, "String") == 0) set_text(unit, variable, equal + 1);
        else set_whole(unit, variable, atoi(equal + 1));
        return;
    }
    stop("no FMU takes the parameter ", dot + 1);
}

static void connect(Unit *units, size_t count) {
    for (Unit *target = units; target < units + count; target++)
        for (size_t at = 0; at < target->count; at++)
            for (Unit *source = units; target->variables[at].is_input && source < units + count; source++) {
                Variable *output = find(source, target->variables[at].name);
                if (output == NULL || !output->is_output || output->size != target->variables[at].size) continue;
                target->variables[at].source = source;
                target->variables[at].source_place = output - source->variables;
            }
}

/* Set the inputs of `unit` for a step, or, from the units before it, at its initialisation. */
static void feed(Unit *unit, int initially) {
    for (size_t at = 0; at < unit->count; at++) {
        Variable *input = &unit->variables[at];
        Unit *source = input->source;
        if (source == NULL || (initially && source >= unit)) continue;
        Variable *output = &source->variables[input->source_place];
        get(source, output);
        set(unit, input, output->values);
    }
}

static void print(Unit *units, size_t count, char **names, size_t asked) {
    for (size_t at = 0; at < asked; at++) {
        Variable *output = NULL;
        for (Unit *unit = units; unit < units + count && output == NULL; unit++) {
            output = find(unit, names[at]);
            if (output != NULL && !output->is_output) output = NULL;
            if (output != NULL) get(unit, output);
        }
        if (output == NULL) stop("no FMU has the output ", names[at]);
        printf("%.17g%c", output->values[0], at + 1 < asked ? ' ' : '\n');
    }
}

int main(int count, char **words) {
    if (count < 4) stop("usage: host STEP_S STEPS FOLDER... [--set X.Y=Z]... [--print OUTPUT]...", "");
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
    for (size_t at = 0; at < given; at++) assign(units, number, sets[at]);
    connect(units, number);
    for (Unit *unit = units; unit < units + number; unit++) {
        begin(unit);
        feed(unit, 1);
        complete(unit);
    }
    print(units, number, names, asked);
    for (long at = 0; at < steps; at++) {
        for (Unit *unit = units; unit < units + number; unit++) {
            feed(unit, 0);
            advance(unit, at * step, step);
        }
        print(units, number, names, asked);
    }
    for (Unit *unit = units; unit < units + number; unit++) finish(unit);
    free(units);
    free(names);
    free(sets);
    return 0;
}
