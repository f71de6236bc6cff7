"""A short day at a machine, by a client of its control: python3 day.py MACHINE

Moves the machine: try it on a simulated one.
"""

import math
import sys

from isocnc import Control, Refused

PART = "G21 G90 G94 G54 G64 P0.01\nG0 X5 Y5\nG1 X30 F3000\nY20\nM2\n"


def work(status):
    """Place of the axes in the work, mm."""
    at = [machine - offset for machine, offset in zip(status["position_mm"], status["work_offset_mm"])]
    turned = math.radians(status["work_rotation_degrees"])
    at[0], at[1] = (
        at[0] * math.cos(turned) + at[1] * math.sin(turned),
        at[1] * math.cos(turned) - at[0] * math.sin(turned),
    )
    return at


def main(machine):
    with Control(machine) as control:
        control.wait(lambda status: status["power"] == "off")
        try:
            control.call("mdi", line="G0 X1")
            sys.exit("a line of MDI with drives off was not refused")
        except Refused as refusal:
            print(f"refused, as it should be: {refusal}")
        control.do("on")
        print("homed:", control.do("home")["homed"])
        control.call("touch_off", axis="X", value=10)
        control.do("mdi", line="G91 G0 X5")
        print("X reads", round(work(control.do("mdi", line="X-2"))[0], 6))
        control.take_control("day.py")
        begun = control.call("program.load", upload=control.upload("part", PART.encode()))
        print(f"{begun['lines']} lines, {begun['planned_time_s']:.1f} s planned")
        way = list(control.path(tolerance_mm=0.01))
        print(len(way), "records of its way, the last on line", way[-1][0])
        at = work(control.do("program.start"))
        print("the part ends at", [round(value, 6) for value in at[:2]])
        control.call("mdi", line="T5 M6")
        with Control(machine) as watcher:
            waiting = next(state["waiting"] for state in watcher.subscribe() if state["waiting"])
        print("waits:", waiting["what"]["text"])
        control.call("tool.changed")
        control.wait()
        control.call("off")
        control.wait(lambda status: status["power"] == "off")
        entries = control.call("journal.since", seq=0)["entries"]
        print(len(entries), "entries in the journal; the last:", entries[-1]["text"])


if __name__ == "__main__":
    main(sys.argv[1])
