#!/usr/bin/env python3
"""How much time the tolerance would still allow to save: path and speed chosen together (needs NumPy and CasADi).

usage: path-bound.py SAMPLES.csv PATH.txt --v 100 --a 1000 --j 2e4 [--feed 100] [--tolerance 0.0095] [--from 0 --to 10]
                     [--step 4] [--fixed]

SAMPLES.csv and PATH.txt come from `isocnc plan --samples --path`, of a program in the XY plane. Every --step ms of the plan a
node is placed that may move across the path as far as the programmed path is within --tolerance. Between nodes both axes move
with constant jerk; positions, speeds, accelerations, jerks and times are the unknowns of a nonlinear programme, solved by
IPOPT from the plan itself, with the states at both ends of the stretch kept. What comes out is a local optimum, feasible at
its nodes: no planner can be much faster near this path. --fixed keeps the geometry and shows what the choice of speed alone
has left.

Prints both times and their ratio; exit code 0.
"""
import argparse
import math

import casadi as ca
import numpy as np


def read_path(name):
    at, moves = None, []
    for words in (line.split() for line in open(name)):
        if words[0] == 'P':
            at = np.array([float(words[1]), float(words[2])])
            continue
        to = np.array([float(words[1]), float(words[2])])
        if words[0] == 'C':
            centre = np.array([float(words[4]), float(words[5])])
            side = 1.0 if float(words[9]) > 0 else -1.0
            moves.append((at, to, centre, np.linalg.norm(at - centre), side))
        else:
            moves.append((at, to))
        at = to
    return moves


def distance(move, p):
    a, b = move[:2]
    if len(move) == 2:
        d = b - a
        x = min(max(np.dot(p - a, d) / max(np.dot(d, d), 1e-300), 0.0), 1.0)
        return np.linalg.norm(p - a - x * d)
    _, _, centre, radius, side = move
    angle = lambda q: math.atan2(*(q - centre)[::-1])
    turn = lambda q: side * (angle(q) - angle(a)) % (2 * math.pi)
    if turn(p) <= turn(b):
        return abs(np.linalg.norm(p - centre) - radius)
    return min(np.linalg.norm(p - a), np.linalg.norm(p - b))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('samples')
    parser.add_argument('path')
    for name, default in (('v', 100), ('a', 1000), ('j', 2e4), ('feed', 100), ('tolerance', 0.0095), ('from', 0), ('to', 10)):
        parser.add_argument('--' + name, type=float, default=default)
    parser.add_argument('--step', type=int, default=4)
    parser.add_argument('--fixed', action='store_true')
    args = parser.parse_args()
    v_max, a_max, j_max, feed = .9999 * args.v, .995 * args.a, .965 * args.j, .9999 * args.feed
    moves = read_path(args.path)
    q = np.loadtxt(args.samples, delimiter=',', skiprows=1)[:, 1:3]
    cycle, tol = 1e-3, args.tolerance
    vel = np.gradient(q, cycle, axis=0)
    acc = np.gradient(vel, cycle, axis=0)
    jerk = np.gradient(acc, cycle, axis=0)
    last = min(int(args.to / cycle), len(q) - 1)
    index = np.arange(max(int(getattr(args, 'from') / cycle), 20), last + 1, args.step)
    # The move of every sample, in order.
    owner, k = np.zeros(last + 1, int), 0
    for i in range(last + 1):
        while k + 1 < len(moves) and distance(moves[k + 1], q[i]) < distance(moves[k], q[i]) - 1e-12:
            k += 1
        owner[i] = k
    n = len(index) - 1
    c, v0, a0 = q[index], vel[index], acc[index]
    along = v0 / np.maximum(np.linalg.norm(v0, axis=1), 1e-9)[:, None]
    across = np.c_[-along[:, 1], along[:, 0]]
    low, high = np.zeros(n + 1), np.zeros(n + 1)
    for i, sample in enumerate(index):
        near = moves[max(0, owner[sample] - 1):owner[sample] + 2]
        for side, bound in ((1, high), (-1, low)):
            d, step = 0.0, tol / 8
            inside = lambda d: min(distance(m, c[i] + side * d * across[i]) for m in near) <= tol
            while d < 2 * tol and inside(d + step):
                d += step
            for _ in range(12):
                step /= 2
                if inside(d + step):
                    d += step
            bound[i] = side * d
    # The ends of moves must not be missed by more, either.
    for a in (m[1] for m in moves[owner[index[0]]:owner[index[-1]]]):
        away = np.linalg.norm(c - a, axis=1)
        i = int(np.argmin(away))
        if away[i] < 2 * tol:
            for side, bound in ((1, high), (-1, low)):
                d = abs(bound[i])
                while d > 0 and np.linalg.norm(c[i] + side * d * across[i] - a) > max(tol, away[i]):
                    d -= tol / 50
                bound[i] = side * max(d, 0.0)
    if args.fixed:
        low, high = np.full(n + 1, -1e-3 * tol), np.full(n + 1, 1e-3 * tol)
    # Unknowns in units of about their limits; time in units of `unit`.
    unit, h0 = 0.01, args.step * cycle
    scale = [v_max * unit, a_max * unit ** 2, j_max * unit ** 3]
    d, h = ca.MX.sym('d', n + 1), ca.MX.sym('h', n)
    v, a, j = ca.MX.sym('v', 2 * (n + 1)), ca.MX.sym('a', 2 * (n + 1)), ca.MX.sym('j', 2 * n)
    t = h * h0 / unit
    equal, speed = [], 0
    for axis in range(2):
        p = c[:, axis] - c[0, axis] + ca.DM(across[:, axis]) * d * tol
        va, aa = (x[axis * (n + 1):(axis + 1) * (n + 1)] * s for x, s in ((v, scale[0]), (a, scale[1])))
        ja = j[axis * n:(axis + 1) * n] * scale[2]
        equal += [(p[1:] - (p[:-1] + va[:-1] * t + aa[:-1] * t ** 2 / 2 + ja * t ** 3 / 6)) * 10,
                  (va[1:] - (va[:-1] + aa[:-1] * t + ja * t ** 2 / 2)) * 3,
                  (aa[1:] - (aa[:-1] + ja * t)) * 10]
        speed += va ** 2
    equal = ca.vertcat(*equal)
    count = int(equal.shape[0])
    x0 = np.concatenate([np.zeros(n + 1), v0.T.ravel() / v_max, a0.T.ravel() / a_max,
                         np.clip(jerk[index[:-1] + args.step // 2].T.ravel() / j_max, -1, 1), np.ones(n)])
    lower = np.concatenate([low / tol, np.full(4 * (n + 1) + 2 * n, -1.0), np.full(n, 0.1)])
    upper = np.concatenate([high / tol, np.full(4 * (n + 1) + 2 * n, 1.0), np.full(n, 5.0)])
    for i in [0, n] + [(n + 1) * k + e for k in range(1, 5) for e in (0, n)]:
        lower[i] = upper[i] = x0[i]
    solver = ca.nlpsol('bound', 'ipopt', {'x': ca.vertcat(d, v, a, j, h), 'f': ca.sum1(h) / n, 'g': ca.vertcat(equal, speed)},
                       {'ipopt.print_level': 0, 'ipopt.sb': 'yes', 'print_time': False, 'ipopt.max_iter': 400, 'ipopt.tol': 1e-5,
                        'ipopt.mu_strategy': 'adaptive', 'ipopt.mu_init': 1e-3, 'ipopt.bound_relax_factor': 0})
    found = solver(x0=x0, lbx=lower, ubx=upper, lbg=np.r_[np.zeros(count), np.full(n + 1, -1.0)],
                   ubg=np.r_[np.zeros(count), np.full(n + 1, (feed * unit) ** 2 + 1e-9)])
    planned, best = n * h0, float(np.array(found['x']).ravel()[-n:].sum()) * h0
    print(f"plan {planned:.3f} s, bound {best:.3f} s, ratio {best / planned:.4f}, {solver.stats()['return_status']}")


main()
