#!/usr/bin/env python3
"""A signal lamp as an external component: green while a program runs, red while it blinks for an alarm.

    [[hal.external]]
    name = "lamp"
    heartbeat_ms = 500
    pins = [
        { name = "running", direction = "in", type = "bit" },
        { name = "alarm", direction = "in", type = "bit" },
        { name = "green", direction = "out", type = "bit", safe = false },
        { name = "red", direction = "out", type = "bit", safe = true },
        { name = "updates", direction = "out", type = "u32", safe = 0 },
    ]

    ./lamp.py [MACHINE]
"""

import signal
import sys
import time

import isocnc_hal


def main():
    # A service manager ends it so: the component is given up, and its outputs fall to their safe values.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    machine = sys.argv[1] if len(sys.argv) > 1 else None
    try:
        with isocnc_hal.claim("lamp", machine) as lamp:
            print(f"lamp: writes its outputs, at the latest every {lamp.heartbeat_s:g} s", flush=True)
            while True:
                try:
                    lamp.update()
                except isocnc_hal.Ended as late:
                    print(f"lamp: {late}", file=sys.stderr)
                    lamp.begin()
                lamp["green"] = lamp["running"] and not lamp["alarm"]
                lamp["red"] = lamp["alarm"] and int(time.monotonic() * 2) % 2 == 0
                lamp["updates"] = (lamp["updates"] + 1) & 0xFFFFFFFF
                time.sleep(lamp.heartbeat_s / 10)
    except isocnc_hal.HalError as error:
        print(f"lamp: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 0


if __name__ == "__main__":
    sys.exit(main())
