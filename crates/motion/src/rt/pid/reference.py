"""A PID loop with feed-forward, written from the description of LinuxCNC's component `pid` alone.

In:  standard input: a line of gains and limits (names of the component, in the order of NAMES), then a line `command feedback` a call.
Out: standard output: the output and whether it is limited (-1, 0, 1), a line a call.
"""

import sys

NAMES = [
    "period", "Pgain", "Igain", "Dgain", "FF0", "FF1", "FF2", "FF3", "bias", "deadband",
    "maxerror", "maxerrorI", "maxerrorD", "maxcmdD", "maxcmdDD", "maxcmdDDD", "maxoutput",
]


def clamp(value, most):
    return value if most == 0 else max(-most, min(most, value))


def main():
    lines = iter(sys.stdin)
    k = dict(zip(NAMES, map(float, next(lines).split())))
    T = k["period"]
    start = float(next(lines))
    old_command, old_feedback, integral = start, start, 0.0
    old_c1, old_c2, limit_state = 0.0, 0.0, 0.0
    for line in lines:
        command, feedback = map(float, line.split())
        error = clamp(old_command - feedback, k["maxerror"])
        band = k["deadband"]
        error = error - band if error > band else error + band if error < -band else 0.0
        if error * limit_state <= 0:
            integral = clamp(integral + error * T, k["maxerrorI"])
        c1 = (command - old_command) / T
        derivative = clamp(c1 - (feedback - old_feedback) / T, k["maxerrorD"])
        c1 = clamp(c1, k["maxcmdD"])
        c2 = clamp((c1 - old_c1) / T, k["maxcmdDD"])
        c3 = clamp((c2 - old_c2) / T, k["maxcmdDDD"])
        wanted = k["bias"] + k["Pgain"] * error + k["Igain"] * integral + k["Dgain"] * derivative
        wanted += k["FF0"] * command + k["FF1"] * c1 + k["FF2"] * c2 + k["FF3"] * c3
        output = clamp(wanted, k["maxoutput"])
        limit_state = (wanted > output) - (wanted < output)
        print(repr(output), limit_state)
        old_command, old_feedback, old_c1, old_c2 = command, feedback, c1, c2


main()
