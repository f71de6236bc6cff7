/* External components of isocnc in C99 or C++11: one header, no library.
 *
 * A component whose pins the machine file declares ([[hal.external]]) belongs to the control; one process at a time writes its
 * outputs and reads its inputs:
 *
 *     isocnc_hal vfd;
 *     if (isocnc_hal_claim(&vfd, NULL, "vfd") != ISOCNC_HAL_OK) { fprintf(stderr, "%s\n", vfd.error); return 1; }
 *     int command = isocnc_hal_pin(&vfd, "speed-cmd"), speed = isocnc_hal_pin(&vfd, "speed");
 *     for (;;) {
 *         if (isocnc_hal_update(&vfd) != ISOCNC_HAL_OK) { fprintf(stderr, "%s\n", vfd.error); break; }
 *         isocnc_hal_set_float(&vfd, speed, isocnc_hal_get_float(&vfd, command));
 *         isocnc_hal_sleep_ms(vfd.heartbeat_ms / 3);
 *     }
 *     isocnc_hal_release(&vfd);
 *
 * isocnc_hal_update takes the inputs, writes all outputs together and renews the heartbeat. A process that does not call it for
 * heartbeat_ms has lost the component: its outputs fall to the safe values of the machine file, and isocnc_hal_update says
 * ISOCNC_HAL_ENDED; isocnc_hal_begin begins anew. One thread uses one isocnc_hal.
 *
 * Include it before other headers, or define _GNU_SOURCE: it needs flock and locks of open files; and a compiler with the atomic
 * built-in functions of GCC, as Clang has them, too. The protocol is in
 * docs/external-components.md. Licence: MIT or Apache 2.0, as isocnc. */
#ifndef ISOCNC_HAL_H
#define ISOCNC_HAL_H

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#if __GCC_ATOMIC_LLONG_LOCK_FREE != 2
#error "words of 64 bits have to be read and written as a whole, without a lock"
#endif

enum {
    ISOCNC_HAL_PINS_MAX = 256,
    ISOCNC_HAL_NAME_MAX = 64,
};

/* What functions give back. */
enum {
    ISOCNC_HAL_OK = 0,
    /* There is no control with such a component, or its file is damaged. */
    ISOCNC_HAL_NONE = -1,
    /* Another process has claimed the component. */
    ISOCNC_HAL_CLAIMED = -2,
    /* The heartbeat was late: outputs have their safe values. isocnc_hal_begin begins anew. */
    ISOCNC_HAL_ENDED = -3,
    /* Another process has written over the session. isocnc_hal_begin begins anew. */
    ISOCNC_HAL_OVERWRITTEN = -4,
    /* The control has ended. Release and claim anew. */
    ISOCNC_HAL_GONE = -5,
};

typedef enum {
    ISOCNC_HAL_BIT = 1,
    ISOCNC_HAL_S32 = 2,
    ISOCNC_HAL_U32 = 3,
    ISOCNC_HAL_S64 = 4,
    ISOCNC_HAL_U64 = 5,
    ISOCNC_HAL_FLOAT = 6,
} isocnc_hal_type;

typedef struct {
    char name[ISOCNC_HAL_NAME_MAX + 1];
    isocnc_hal_type type;
    /* Written by this process. */
    bool is_output;
} isocnc_hal_pin_info;

typedef struct {
    /* What went wrong last. */
    char error[256];
    /* Within what time isocnc_hal_update is to be called again. */
    unsigned heartbeat_ms;
    /* Its pins: inputs, then outputs. */
    int pins, inputs;
    isocnc_hal_pin_info info[ISOCNC_HAL_PINS_MAX];
    /* Values: of inputs as the last update has seen them, of outputs as the next one writes them. */
    uint64_t cells[ISOCNC_HAL_PINS_MAX];

    /* All below is private. */
    int file;
    uint64_t *words;
    size_t octets;
    uint64_t session, written, seen;
    uint64_t scratch[ISOCNC_HAL_PINS_MAX];
} isocnc_hal;

/* Words of the file; see docs/external-components.md. */
enum {
    ISOCNC_HAL__MAGIC = 0,
    ISOCNC_HAL__VERSION = 1,
    ISOCNC_HAL__FILE_LEN = 2,
    ISOCNC_HAL__PINS = 3,
    ISOCNC_HAL__INPUTS = 4,
    ISOCNC_HAL__HEARTBEAT_MS = 5,
    ISOCNC_HAL__SESSION = 8,
    ISOCNC_HAL__HOLDER = 9,
    ISOCNC_HAL__LATEST_OUTPUTS = 10,
    ISOCNC_HAL__CLAIMS = 11,
    ISOCNC_HAL__ENDED = 12,
    ISOCNC_HAL__LATEST_INPUTS = 13,
    ISOCNC_HAL__HEADER = 16,
    ISOCNC_HAL__PIN = 2 + ISOCNC_HAL_NAME_MAX / 8,
    ISOCNC_HAL__FRAME = 3,
};

static inline uint64_t isocnc_hal__mix(uint64_t check, uint64_t word) {
    uint64_t mixed = (check ^ word) * UINT64_C(0x9E3779B97F4A7C15);
    return mixed ^ (mixed >> 32);
}

static inline uint64_t isocnc_hal__load(const isocnc_hal *hal, size_t word) {
    return __atomic_load_n(&hal->words[word], __ATOMIC_ACQUIRE);
}

static inline void isocnc_hal__store(isocnc_hal *hal, size_t word, uint64_t value) {
    __atomic_store_n(&hal->words[word], value, __ATOMIC_RELEASE);
}

/* First word of the place for a record: outputs first, then inputs with outputs. */
static inline size_t isocnc_hal__place(const isocnc_hal *hal, bool of_outputs, uint64_t number) {
    size_t outputs = (size_t)(hal->pins - hal->inputs), values = of_outputs ? outputs : (size_t)hal->pins;
    size_t first = ISOCNC_HAL__HEADER + (size_t)hal->pins * ISOCNC_HAL__PIN;
    if (!of_outputs) {
        first += 2 * (outputs + ISOCNC_HAL__FRAME);
    }
    return first + (number & 1) * (values + ISOCNC_HAL__FRAME);
}

/* Takes a fresh record of what the control shows into scratch. */
static inline bool isocnc_hal__look(isocnc_hal *hal) {
    for (int tries = 0; tries < 3; tries++) {
        uint64_t latest = isocnc_hal__load(hal, ISOCNC_HAL__LATEST_INPUTS);
        if (latest == hal->seen || latest == 0) {
            return false;
        }
        size_t place = isocnc_hal__place(hal, false, latest);
        uint64_t number = isocnc_hal__load(hal, place);
        uint64_t check = isocnc_hal__mix(isocnc_hal__mix(1, number), isocnc_hal__load(hal, place + 1));
        for (int pin = 0; pin < hal->pins; pin++) {
            hal->scratch[pin] = isocnc_hal__load(hal, place + 2 + (size_t)pin);
            check = isocnc_hal__mix(check, hal->scratch[pin]);
        }
        if (number == latest && check == isocnc_hal__load(hal, place + 2 + (size_t)hal->pins)) {
            hal->seen = latest;
            return true;
        }
    }
    return false;
}

/* Whether the control holds its lock on a file. */
static inline bool isocnc_hal__runs(int file) {
    struct flock whole;
    memset(&whole, 0, sizeof whole);
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    return fcntl(file, F_OFD_GETLK, &whole) == 0 && whole.l_type != F_UNLCK;
}

static inline int isocnc_hal__failed(isocnc_hal *hal, int code, const char *what) {
    snprintf(hal->error, sizeof hal->error, "%s", what);
    return code;
}

static inline void isocnc_hal_sleep_ms(unsigned ms) {
    struct timespec time;
    time.tv_sec = (time_t)(ms / 1000);
    time.tv_nsec = (long)(ms % 1000) * 1000000;
    while (nanosleep(&time, &time) != 0 && errno == EINTR) {
    }
}

/* Folders of this user's controls, best first; gives how many of the four there are. */
static inline int isocnc_hal__folders(char folders[4][160]) {
    const char *runtime = getenv("XDG_RUNTIME_DIR");
    char places[4][160];
    snprintf(places[0], sizeof places[0], "/run/isocnc");
    snprintf(places[1], sizeof places[1], "%.140s/isocnc", runtime != NULL ? runtime : "/run");
    snprintf(places[2], sizeof places[2], "/run/user/%u/isocnc", (unsigned)geteuid());
    snprintf(places[3], sizeof places[3], "/dev/shm/isocnc-%u", (unsigned)geteuid());
    int count = 0;
    for (int place = 0; place < 4; place++) {
        struct stat found;
        bool is_again = false;
        for (int before = 0; before < place; before++) {
            is_again |= strcmp(places[before], places[place]) == 0;
        }
        /* Of this user, and nobody else may enter. */
        if (!is_again && lstat(places[place], &found) == 0 && S_ISDIR(found.st_mode) && found.st_uid == geteuid() &&
            (found.st_mode & 077) == 0) {
            memcpy(folders[count++], places[place], sizeof places[place]);
        }
    }
    return count;
}

/* Opens the file of a component; -1: it is not there, or its control does not run. */
static inline int isocnc_hal__open(const char *folder, const char *name) {
    char path[512];
    if (snprintf(path, sizeof path, "%s/%s", folder, name) >= (int)sizeof path) {
        return -1;
    }
    int file = open(path, O_RDWR | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    struct stat found;
    if (file >= 0 && (fstat(file, &found) != 0 || !S_ISREG(found.st_mode) || found.st_uid != geteuid() ||
                      !isocnc_hal__runs(file))) {
        close(file);
        return -1;
    }
    return file;
}

/* Finds the file of a component; machine may be NULL where one control alone has it. */
static inline int isocnc_hal__find(isocnc_hal *hal, const char *machine, const char *component) {
    char folders[4][160], prefix[96];
    int count = isocnc_hal__folders(folders), found = -1;
    if (strlen(component) > ISOCNC_HAL_NAME_MAX) {
        return -1;
    }
    snprintf(prefix, sizeof prefix, "isocnc-external-%s.", component);
    for (char *letter = prefix; letter < prefix + strlen(prefix) - 1; letter++) {
        *letter = *letter == '.' ? '_' : *letter;
    }
    for (int folder = 0; folder < count; folder++) {
        DIR *entries = opendir(folders[folder]);
        for (struct dirent *entry; entries != NULL && (entry = readdir(entries)) != NULL;) {
            size_t length = strlen(prefix);
            if (strncmp(entry->d_name, prefix, length) != 0 ||
                (machine != NULL && strcmp(entry->d_name + length, machine) != 0)) {
                continue;
            }
            int file = isocnc_hal__open(folders[folder], entry->d_name);
            if (file >= 0 && found >= 0) {
                close(file);
                close(found);
                closedir(entries);
                isocnc_hal__failed(hal, 0, "several controls have this component: name the machine");
                return -1;
            }
            found = file >= 0 ? file : found;
        }
        if (entries != NULL) {
            closedir(entries);
        }
    }
    return found;
}

/* Reads what the control says of the component; it may be damaged. */
static inline bool isocnc_hal__read(isocnc_hal *hal) {
    static const char magic[9] = "isocEXT\n";
    uint64_t first;
    memcpy(&first, magic, sizeof first);
    if (isocnc_hal__load(hal, ISOCNC_HAL__MAGIC) != first || isocnc_hal__load(hal, ISOCNC_HAL__VERSION) != 1) {
        return false;
    }
    uint64_t pins = isocnc_hal__load(hal, ISOCNC_HAL__PINS), inputs = isocnc_hal__load(hal, ISOCNC_HAL__INPUTS);
    if (pins > ISOCNC_HAL_PINS_MAX || inputs > pins) {
        return false;
    }
    hal->pins = (int)pins;
    hal->inputs = (int)inputs;
    if (8 * isocnc_hal__place(hal, false, 1) + 8 * (pins + ISOCNC_HAL__FRAME) != hal->octets) {
        return false;
    }
    for (size_t pin = 0; pin < pins; pin++) {
        size_t word = ISOCNC_HAL__HEADER + pin * ISOCNC_HAL__PIN;
        uint64_t meta = isocnc_hal__load(hal, word), length = meta >> 16;
        unsigned type = meta & 0xFF, direction = (meta >> 8) & 0xFF;
        bool is_output = pin >= inputs;
        if (type < ISOCNC_HAL_BIT || type > ISOCNC_HAL_FLOAT || direction != (is_output ? 1U : 2U) ||
            length > ISOCNC_HAL_NAME_MAX) {
            return false;
        }
        uint64_t name[ISOCNC_HAL_NAME_MAX / 8];
        for (size_t part = 0; part < ISOCNC_HAL_NAME_MAX / 8; part++) {
            name[part] = isocnc_hal__load(hal, word + 2 + part);
        }
        memset(hal->info[pin].name, 0, sizeof hal->info[pin].name);
        memcpy(hal->info[pin].name, name, (size_t)length);
        hal->info[pin].type = (isocnc_hal_type)type;
        hal->info[pin].is_output = is_output;
    }
    hal->heartbeat_ms = (unsigned)isocnc_hal__load(hal, ISOCNC_HAL__HEARTBEAT_MS);
    return true;
}

/* Begins a session, with outputs as they are in the control now. */
static inline int isocnc_hal_begin(isocnc_hal *hal) {
    int waited_ms = 0;
    while (!isocnc_hal__look(hal)) {
        if (++waited_ms > 2000 || !isocnc_hal__runs(hal->file)) {
            return isocnc_hal__failed(hal, ISOCNC_HAL_GONE, "the control shows no values: it has ended, or hangs");
        }
        isocnc_hal_sleep_ms(1);
    }
    memcpy(hal->cells, hal->scratch, sizeof hal->cells);
    uint64_t ended = isocnc_hal__load(hal, ISOCNC_HAL__ENDED), session = isocnc_hal__load(hal, ISOCNC_HAL__CLAIMS) + 1;
    while (session == 0 || session == ended) {
        session++;
    }
    isocnc_hal__store(hal, ISOCNC_HAL__CLAIMS, session);
    isocnc_hal__store(hal, ISOCNC_HAL__HOLDER, (uint64_t)getpid());
    isocnc_hal__store(hal, ISOCNC_HAL__SESSION, session);
    hal->session = session;
    return ISOCNC_HAL_OK;
}

/* Gives the component up: its outputs fall to their safe values at once. */
static inline void isocnc_hal_release(isocnc_hal *hal) {
    if (hal->words != NULL) {
        if (hal->session != 0 && isocnc_hal__load(hal, ISOCNC_HAL__SESSION) == hal->session) {
            isocnc_hal__store(hal, ISOCNC_HAL__SESSION, 0);
        }
        munmap((void *)hal->words, hal->octets);
        hal->words = NULL;
    }
    if (hal->file >= 0) {
        close(hal->file);
        hal->file = -1;
    }
}

/* Claims a component of a running control; machine may be NULL where one control alone has it. On failure nothing is kept. */
static inline int isocnc_hal_claim(isocnc_hal *hal, const char *machine, const char *component) {
    memset(hal, 0, sizeof *hal);
    snprintf(hal->error, sizeof hal->error, "no control of this user that runs has an external component '%s'", component);
    hal->file = isocnc_hal__find(hal, machine, component);
    if (hal->file < 0) {
        return ISOCNC_HAL_NONE;
    }
    int code = ISOCNC_HAL_NONE;
    struct stat found;
    void *map = MAP_FAILED;
    if (fstat(hal->file, &found) == 0 && found.st_size >= 8 * ISOCNC_HAL__HEADER && found.st_size < 1 << 20) {
        hal->octets = (size_t)found.st_size;
        map = mmap(NULL, hal->octets, PROT_READ | PROT_WRITE, MAP_SHARED, hal->file, 0);
    }
    hal->words = map != MAP_FAILED ? (uint64_t *)map : NULL;
    if (hal->words == NULL || !isocnc_hal__read(hal)) {
        isocnc_hal__failed(hal, code, "the file of the component is damaged, or of another version of isocnc");
    } else if (flock(hal->file, LOCK_EX | LOCK_NB) != 0) {
        code = ISOCNC_HAL_CLAIMED;
        snprintf(hal->error, sizeof hal->error,
                 "external component '%s' is claimed by process %llu: it has one writer at a time; end that process first",
                 component, (unsigned long long)isocnc_hal__load(hal, ISOCNC_HAL__HOLDER));
    } else {
        hal->written = isocnc_hal__load(hal, ISOCNC_HAL__LATEST_OUTPUTS);
        code = isocnc_hal_begin(hal);
    }
    if (code != ISOCNC_HAL_OK) {
        isocnc_hal_release(hal);
    }
    return code;
}

/* Takes inputs, writes all outputs together, renews the heartbeat. Where it fails nothing was written. */
static inline int isocnc_hal_update(isocnc_hal *hal) {
    if (hal->words == NULL) {
        return isocnc_hal__failed(hal, ISOCNC_HAL_NONE, "no component is claimed");
    }
    bool is_new = isocnc_hal__look(hal);
    if (!is_new && !isocnc_hal__runs(hal->file)) {
        return isocnc_hal__failed(hal, ISOCNC_HAL_GONE, "the control has ended");
    }
    if (isocnc_hal__load(hal, ISOCNC_HAL__ENDED) == hal->session) {
        return isocnc_hal__failed(hal, ISOCNC_HAL_ENDED, "the heartbeat was late: the control has ended the session");
    }
    if (isocnc_hal__load(hal, ISOCNC_HAL__SESSION) != hal->session) {
        return isocnc_hal__failed(hal, ISOCNC_HAL_OVERWRITTEN, "another process has written over the session");
    }
    if (is_new) {
        memcpy(hal->cells, hal->scratch, (size_t)hal->inputs * sizeof *hal->cells);
    }
    hal->written = hal->written + 1 != 0 ? hal->written + 1 : 1;
    size_t place = isocnc_hal__place(hal, true, hal->written), outputs = (size_t)(hal->pins - hal->inputs);
    uint64_t check = isocnc_hal__mix(isocnc_hal__mix(1, hal->written), hal->session);
    isocnc_hal__store(hal, place, hal->written);
    isocnc_hal__store(hal, place + 1, hal->session);
    for (size_t output = 0; output < outputs; output++) {
        uint64_t cell = hal->cells[(size_t)hal->inputs + output];
        isocnc_hal__store(hal, place + 2 + output, cell);
        check = isocnc_hal__mix(check, cell);
    }
    isocnc_hal__store(hal, place + 2 + outputs, check);
    isocnc_hal__store(hal, ISOCNC_HAL__LATEST_OUTPUTS, hal->written);
    return ISOCNC_HAL_OK;
}

/* Number of a pin by its name behind that of the component; -1: there is none. */
static inline int isocnc_hal_pin(const isocnc_hal *hal, const char *name) {
    for (int pin = 0; pin < hal->pins; pin++) {
        if (strcmp(hal->info[pin].name, name) == 0) {
            return pin;
        }
    }
    return -1;
}

/* Values. A pin that there is not, or of another type, reads as 0 and keeps what it has; so does an input that is set. */
static inline uint64_t isocnc_hal__get(const isocnc_hal *hal, int pin, isocnc_hal_type type) {
    return pin >= 0 && pin < hal->pins && hal->info[pin].type == type ? hal->cells[pin] : 0;
}

static inline bool isocnc_hal__set(isocnc_hal *hal, int pin, isocnc_hal_type type, uint64_t cell) {
    if (pin < hal->inputs || pin >= hal->pins || hal->info[pin].type != type) {
        return false;
    }
    hal->cells[pin] = cell;
    return true;
}

static inline bool isocnc_hal_get_bit(const isocnc_hal *hal, int pin) {
    return isocnc_hal__get(hal, pin, ISOCNC_HAL_BIT) != 0;
}
static inline int32_t isocnc_hal_get_s32(const isocnc_hal *hal, int pin) {
    return (int32_t)(uint32_t)isocnc_hal__get(hal, pin, ISOCNC_HAL_S32);
}
static inline uint32_t isocnc_hal_get_u32(const isocnc_hal *hal, int pin) {
    return (uint32_t)isocnc_hal__get(hal, pin, ISOCNC_HAL_U32);
}
static inline int64_t isocnc_hal_get_s64(const isocnc_hal *hal, int pin) {
    return (int64_t)isocnc_hal__get(hal, pin, ISOCNC_HAL_S64);
}
static inline uint64_t isocnc_hal_get_u64(const isocnc_hal *hal, int pin) {
    return isocnc_hal__get(hal, pin, ISOCNC_HAL_U64);
}
static inline double isocnc_hal_get_float(const isocnc_hal *hal, int pin) {
    uint64_t cell = isocnc_hal__get(hal, pin, ISOCNC_HAL_FLOAT);
    double value;
    memcpy(&value, &cell, sizeof value);
    return value;
}
/* They say whether the pin is an output of that type. */
static inline bool isocnc_hal_set_bit(isocnc_hal *hal, int pin, bool value) {
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_BIT, value);
}
static inline bool isocnc_hal_set_s32(isocnc_hal *hal, int pin, int32_t value) {
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_S32, (uint32_t)value);
}
static inline bool isocnc_hal_set_u32(isocnc_hal *hal, int pin, uint32_t value) {
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_U32, value);
}
static inline bool isocnc_hal_set_s64(isocnc_hal *hal, int pin, int64_t value) {
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_S64, (uint64_t)value);
}
static inline bool isocnc_hal_set_u64(isocnc_hal *hal, int pin, uint64_t value) {
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_U64, value);
}
static inline bool isocnc_hal_set_float(isocnc_hal *hal, int pin, double value) {
    uint64_t cell;
    memcpy(&cell, &value, sizeof cell);
    return isocnc_hal__set(hal, pin, ISOCNC_HAL_FLOAT, cell);
}

#endif
