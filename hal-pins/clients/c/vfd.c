/* A frequency converter as an external component: follows the commanded speed at 600 1/min in a second, and says when it is there.
 * In a real one, the two lines that follow the command talk to the converter.
 *
 *     [[hal.external]]
 *     name = "vfd"
 *     heartbeat_ms = 100
 *     pins = [
 *         { name = "run", direction = "in", type = "bit" },
 *         { name = "speed-cmd", direction = "in", type = "float" },
 *         { name = "speed", direction = "out", type = "float", safe = 0.0 },
 *         { name = "at-speed", direction = "out", type = "bit", safe = false },
 *         { name = "updates", direction = "out", type = "u32", safe = 0 },
 *     ]
 *
 * cc -std=c99 -O2 -o vfd vfd.c -lm && ./vfd [MACHINE] */
#include "isocnc_hal.h"

#include <math.h>
#include <signal.h>

static volatile sig_atomic_t is_ended;

static void end(int signal) {
    (void)signal;
    is_ended = 1;
}

int main(int count, char **words) {
    isocnc_hal vfd;
    if (isocnc_hal_claim(&vfd, count > 1 ? words[1] : NULL, "vfd") != ISOCNC_HAL_OK) {
        fprintf(stderr, "vfd: %s\n", vfd.error);
        return 1;
    }
    signal(SIGINT, end);
    signal(SIGTERM, end);
    int run = isocnc_hal_pin(&vfd, "run"), command = isocnc_hal_pin(&vfd, "speed-cmd");
    int speed = isocnc_hal_pin(&vfd, "speed"), at_speed = isocnc_hal_pin(&vfd, "at-speed");
    int updates = isocnc_hal_pin(&vfd, "updates");
    unsigned period_ms = vfd.heartbeat_ms / 5 > 0 ? vfd.heartbeat_ms / 5 : 1;
    /* Where it goes on from: the values that the pins have now. */
    double now = isocnc_hal_get_float(&vfd, speed);
    printf("vfd: writes its outputs every %u ms\n", period_ms);
    fflush(stdout);
    int code = ISOCNC_HAL_OK;
    while (!is_ended) {
        code = isocnc_hal_update(&vfd);
        if (code == ISOCNC_HAL_ENDED || code == ISOCNC_HAL_OVERWRITTEN) {
            fprintf(stderr, "vfd: %s\n", vfd.error);
            code = isocnc_hal_begin(&vfd);
            now = isocnc_hal_get_float(&vfd, speed);
        }
        if (code != ISOCNC_HAL_OK) {
            fprintf(stderr, "vfd: %s\n", vfd.error);
            break;
        }
        double wanted = isocnc_hal_get_bit(&vfd, run) ? isocnc_hal_get_float(&vfd, command) : 0.0;
        double step = 600.0 * period_ms / 1000.0;
        now += fmin(fmax(wanted - now, -step), step);
        isocnc_hal_set_float(&vfd, speed, now);
        isocnc_hal_set_bit(&vfd, at_speed, wanted != 0.0 && fabs(wanted - now) < 1.0);
        isocnc_hal_set_u32(&vfd, updates, isocnc_hal_get_u32(&vfd, updates) + 1);
        isocnc_hal_sleep_ms(period_ms);
    }
    isocnc_hal_release(&vfd);
    return code == ISOCNC_HAL_OK ? 0 : 1;
}
