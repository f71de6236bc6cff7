"""A whole job by grbl-streamer: homes, streams, waits until the machine rests.

In:  the serial port, a file of G-code. Out: exit code 0 and a line with what was seen, or what was missing.
"""

import os
import sys
import threading
import time
import traceback

from grbl_streamer import GrblStreamer

WAIT_S = 180


def main(port, job):
    seen = {name: threading.Event() for name in ("on_boot", "on_job_completed", "on_standstill")}
    wrong, states = [], []

    def callback(event, *data):
        if event in ("on_error", "on_alarm"):
            wrong.append((event, data))
        if event == "on_stateupdate":
            states.append(data[0])
        if event in seen:
            seen[event].set()

    grbl = GrblStreamer(callback)
    grbl.setup_logging()
    grbl.cnect(port, 115200)
    assert seen["on_boot"].wait(20), "it was not greeted"
    grbl.poll_start()
    # Locked until it is homed.
    grbl.homing()
    until = time.monotonic() + WAIT_S
    while not (states and states[-1] == "Idle"):
        assert time.monotonic() < until, f"homing does not end: {states[-5:]} {wrong}"
        time.sleep(0.1)
    wrong.clear()
    # A reset ends whatever job there was.
    seen["on_job_completed"].clear()
    grbl.incremental_streaming = False
    grbl.load_file(job)
    grbl.job_run()
    assert seen["on_job_completed"].wait(WAIT_S), f"the job does not end: {states[-5:]} {wrong}"
    # The job is completed with the answer to its last line; the machine may be seen to rest a moment later.
    while states[-1] != "Idle" or "Run" not in states:
        assert time.monotonic() < until, f"it does not come to rest: {states[-5:]} {wrong}"
        time.sleep(0.1)
    grbl.disconnect()
    assert not wrong, wrong
    assert "Run" in states, states
    print("done", len(states), "states")


try:
    main(*sys.argv[1:])
    code = 0
except BaseException:
    traceback.print_exc()
    code = 1
sys.stdout.flush()
sys.stderr.flush()
# The sender's own threads would keep this process for ever.
os._exit(code)
