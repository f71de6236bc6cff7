// Calls the functions of one of LinuxCNC's HAL modules row by row: no shared memory, no thread, no root.
//
// usage: halrun-oracle MODULE [--link PIN].. [--first FUNCTION].. [key=value]..     (the words of `loadrt`)
//
// stdout: a line `NAME DIRECTION TYPE VALUE` for each pin and parameter in the order in which the module made them, an empty line, then
//         for each row 8 octets for each that is `out` or `io`.
// stdin:  for each row the period [ns] and 8 octets for each that is `in` or `io`. They are written only where they are others than in the
//         row before, as `setp` would: the module may write `io` pins and parameters, too.
// Octets are the machine's own: a double, or an integer as a 64-bit one. All functions of the module are called in each row, those named by
// `--first` before the others. A pin named by `--link` is on a signal.
//
// Compile: cc -O2 -rdynamic -DMODULES='"/usr/lib/linuxcnc/modules"' halrun-oracle.c -ldl -lm     (scripts/halrun-oracle.sh does)
//
// It stands in for LinuxCNC's `rtapi_app` and `hal_lib`: what modules ask of them is here, by the names and types of hal.h.

#include <dlfcn.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BIT = 1, FLOAT = 2, S32 = 3, U32 = 4 };
enum { PIN_IN = 16, PIN_OUT = 32, PIN_IO = 48, PARAM_RO = 64, PARAM_RW = 192 };
enum { MOST = 1000 };

struct pin {
    char name[128];
    int type, direction;
    void **pointer; // of a pin: where the module looks for its memory
    void *memory;
    uint64_t before; // last word that was written
};

static struct pin pins[MOST];
static int pin_count;

struct function {
    char name[128];
    void (*call)(void *, long);
    void *argument;
};

static struct function functions[MOST];
static int function_count;
static int runs; // what modules say call by call is of no interest

static void fail(const char *what, const char *of) {
    fprintf(stderr, "halrun-oracle: %s: %s\n", of, what);
    exit(2);
}

// What modules ask of rtapi and HAL.

void *hal_malloc(long size) { return calloc(1, size + 16); }
int hal_init(const char *name) { return name ? 1 : -1; }
int hal_ready(int id) { return id ? 0 : -1; }
int hal_exit(int id) { return id ? 0 : -1; }
int rtapi_get_msg_level(void) { return 1; }
int rtapi_set_msg_level(int level) { return level ? 0 : 0; }
long long rtapi_get_time(void) { return 0; }
long long rtapi_get_clocks(void) { return 0; }

void rtapi_print_msg(int level, const char *format, ...) {
    va_list list;
    va_start(list, format);
    if (level <= 1 && !runs)
        vfprintf(stderr, format, list);
    va_end(list);
}

void rtapi_print(const char *format, ...) { (void)format; }

int rtapi_snprintf(char *to, unsigned long size, const char *format, ...) {
    va_list list;
    va_start(list, format);
    int length = vsnprintf(to, size, format, list);
    va_end(list);
    return length;
}

static int add(const char *format, va_list list, int type, int direction, void **pointer, void *memory) {
    if (pin_count == MOST)
        fail("too many pins", "MODULE");
    struct pin *pin = &pins[pin_count++];
    vsnprintf(pin->name, sizeof pin->name, format, list);
    pin->type = type;
    pin->direction = direction;
    pin->pointer = pointer;
    pin->memory = memory;
    if (pointer)
        *pointer = pin->memory = hal_malloc(8);
    return 0;
}

#define NEW(kind, TYPE)                                                                      \
    int hal_pin_##kind##_newf(int direction, void **pointer, int id, const char *format, ...) { \
        (void)id;                                                                            \
        va_list list;                                                                        \
        va_start(list, format);                                                              \
        int result = add(format, list, TYPE, direction, pointer, NULL);                      \
        va_end(list);                                                                        \
        return result;                                                                       \
    }                                                                                        \
    int hal_param_##kind##_newf(int direction, void *memory, int id, const char *format, ...) { \
        (void)id;                                                                            \
        va_list list;                                                                        \
        va_start(list, format);                                                              \
        int result = add(format, list, TYPE, direction, NULL, memory);                       \
        va_end(list);                                                                        \
        return result;                                                                       \
    }                                                                                        \
    int hal_pin_##kind##_new(const char *name, int direction, void **pointer, int id) {      \
        return hal_pin_##kind##_newf(direction, pointer, id, "%s", name);                    \
    }                                                                                        \
    int hal_param_##kind##_new(const char *name, int direction, void *memory, int id) {      \
        return hal_param_##kind##_newf(direction, memory, id, "%s", name);                   \
    }

NEW(bit, BIT)
NEW(float, FLOAT)
NEW(s32, S32)
NEW(u32, U32)

int hal_pin_new(const char *name, int type, int direction, void **pointer, int id) {
    switch (type) {
        case BIT: return hal_pin_bit_new(name, direction, pointer, id);
        case FLOAT: return hal_pin_float_new(name, direction, pointer, id);
        case S32: return hal_pin_s32_new(name, direction, pointer, id);
        case U32: return hal_pin_u32_new(name, direction, pointer, id);
        default: return -1;
    }
}

int hal_export_funct(const char *name, void (*call)(void *, long), void *argument, int fp, int reentrant, int id) {
    (void)fp, (void)reentrant, (void)id;
    if (function_count == MOST)
        fail("too many functions", name);
    struct function *function = &functions[function_count++];
    snprintf(function->name, sizeof function->name, "%s", name);
    function->call = call;
    function->argument = argument;
    return 0;
}

// Values.

static uint64_t word(const struct pin *pin) {
    uint64_t word = 0;
    switch (pin->type) {
        case BIT: return *(volatile uint8_t *)pin->memory != 0;
        case S32: return (uint64_t)(int64_t) * (int32_t *)pin->memory;
        case U32: return *(uint32_t *)pin->memory;
        default: memcpy(&word, pin->memory, 8); return word;
    }
}

static void set(struct pin *pin, uint64_t word) {
    switch (pin->type) {
        case BIT: *(uint8_t *)pin->memory = word != 0; break;
        case S32:
        case U32: *(uint32_t *)pin->memory = (uint32_t)word; break;
        default: memcpy(pin->memory, &word, 8);
    }
}

static int is_written(const struct pin *pin) {
    return pin->direction == PIN_IN || pin->direction == PIN_IO || pin->direction == PARAM_RW;
}

static int is_told(const struct pin *pin) {
    return pin->direction == PIN_OUT || pin->direction == PIN_IO || pin->direction == PARAM_RO;
}

// A word of `loadrt`.

static void give(void *module, char *word) {
    char *value = strchr(word, '='), symbol[160];
    if (!value)
        fail("is no key=value", word);
    *value++ = 0;
    snprintf(symbol, sizeof symbol, "rtapi_info_address_%s", word);
    void **address = dlsym(module, symbol);
    snprintf(symbol, sizeof symbol, "rtapi_info_type_%s", word);
    char **type = dlsym(module, symbol);
    if (!address || !type)
        fail("the module has no such parameter", word);
    int at = 0;
    snprintf(symbol, sizeof symbol, "rtapi_info_size_%s", word);
    char *rest = dlsym(module, symbol) ? value : NULL;
    for (char *item = rest ? strsep(&rest, ",") : value; item; item = strsep(&rest, ","), at++) {
        switch (**type) {
            case 'i': ((int *)*address)[at] = (int)strtol(item, NULL, 0); break;
            case 'l': ((long *)*address)[at] = strtol(item, NULL, 0); break;
            default: ((char **)*address)[at] = item;
        }
    }
}

int main(int count, char **words) {
    if (count < 2)
        fail("MODULE [--link PIN].. [--first FUNCTION].. [key=value]..", "usage: halrun-oracle");
    char file[4096];
    snprintf(file, sizeof file, "%s/%s.so", MODULES, words[1]);
    void *module = dlopen(file, RTLD_NOW);
    if (!module)
        fail(dlerror(), words[1]);
    for (int at = 2; at < count; at++) {
        if (!strncmp(words[at], "--", 2))
            at++;
        else
            give(module, words[at]);
    }
    int (*start)(void) = (int (*)(void))dlsym(module, "rtapi_app_main");
    if (!start || start() < 0)
        fail("does not start", words[1]);
    int firsts = 0;
    for (int at = 2; at + 1 < count; at++) {
        if (!strcmp(words[at], "--link")) {
            int found = 0;
            for (struct pin *pin = pins; pin < pins + pin_count; pin++) {
                if (pin->pointer && !strcmp(pin->name, words[at + 1])) {
                    void *signal = hal_malloc(8);
                    memcpy(signal, pin->memory, 8);
                    *pin->pointer = pin->memory = signal;
                    found = 1;
                }
            }
            if (!found)
                fail("there is no such pin", words[at + 1]);
        } else if (!strcmp(words[at], "--first")) {
            int from = firsts;
            while (from < function_count && strcmp(functions[from].name, words[at + 1]))
                from++;
            if (from == function_count)
                fail("there is no such function", words[at + 1]);
            struct function first = functions[from];
            memmove(&functions[firsts + 1], &functions[firsts], (from - firsts) * sizeof first);
            functions[firsts++] = first;
        }
    }
    for (struct pin *pin = pins; pin < pins + pin_count; pin++) {
        static const char *types[] = {"", "bit", "float", "s32", "u32"};
        pin->before = word(pin);
        double number;
        memcpy(&number, &pin->before, 8);
        printf("%s %s %s ", pin->name, !is_told(pin) ? "in" : is_written(pin) ? "io" : "out", types[pin->type]);
        if (pin->type == FLOAT)
            printf("%.17g\n", number);
        else
            printf("%lld\n", (long long)pin->before);
    }
    printf("\n");
    runs = 1;
    int64_t period_ns;
    while (fread(&period_ns, 8, 1, stdin) == 1) {
        for (struct pin *pin = pins; pin < pins + pin_count; pin++) {
            uint64_t value;
            if (!is_written(pin))
                continue;
            if (fread(&value, 8, 1, stdin) != 1)
                fail("ends within a row", "stdin");
            if (value != pin->before)
                set(pin, value);
            pin->before = value;
        }
        for (int at = 0; at < function_count; at++)
            functions[at].call(functions[at].argument, (long)period_ns);
        for (struct pin *pin = pins; pin < pins + pin_count; pin++) {
            uint64_t value = word(pin);
            if (is_told(pin))
                fwrite(&value, 8, 1, stdout);
        }
    }
    return 0;
}
