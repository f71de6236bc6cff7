#!/usr/bin/env python3
"""How near a plan is to the shortest time on its own smoothed path (needs NumPy and SciPy).

usage: reference-times.py SMOOTHED.csv --v 100,100,100 --a 1000,1000,1000 --j 2e4,2e4,2e4 [--piece 350] [--cells 500]
                          [--topp topp_ref.py]

SMOOTHED.csv comes from `isocnc plan --smoothed`: a point per millisecond with exact derivatives by length. Every section
between two rests is cut into pieces of about --piece mm where the plan is slowest. In a piece, the square b of the speed is
improved by sequential linear programming from the plan's own profile, with speed and acceleration at both ends kept; then
once more with the cuts elsewhere, so that what the first cuts held back is free. Every piece begins with the plan, so the
reference never is slower than the plan on this grid. With --topp, sections of one piece are also solved by topp_vaj of that
script, from its own start; the shorter time counts.

Prints the plan's time, the reference and their ratio; exit code 0.
"""
import argparse
import importlib.util
import sys

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_matrix


def time_of(b, h):
    r = np.sqrt(np.maximum(b, 0))
    return float(np.sum(2 * h / np.maximum(r[1:] + r[:-1], 1e-12)))


class Section:
    """One stretch from rest to rest on a grid of its own points."""

    def __init__(self, table, axes, lim):
        self.s, self.v, self.feed = table[:, 2], table[:, 3], table[:, 4]
        self.time = table[-1, 1] - table[0, 1]
        d = table[:, 5:].reshape(len(table), 4, axes)
        self.d1, self.d2, self.d3 = d[:, 1], d[:, 2], d[:, 3]
        self.lim = lim
        self.b = self.v ** 2
        self.b[0] = self.b[-1] = 0.0

    def thinned(self, cells):
        """Points about even in time, at least `cells` for each --piece; the ends and the smallest speeds stay."""
        n = len(self.s)
        keep = np.unique(np.linspace(0, n - 1, max(3, min(n, cells))).round().astype(int))
        out = object.__new__(Section)
        for name in ('s', 'v', 'feed', 'd1', 'd2', 'd3', 'b'):
            setattr(out, name, getattr(self, name)[keep])
        out.lim, out.time = self.lim, self.time
        return out

    def improve(self, lo, hi, iterations=25):
        """Improves b between two grid points, whose states stay (a rest stays a rest)."""
        V, A, J = self.lim
        s = self.s[lo:hi + 1]
        h = np.diff(s)
        n = len(h)
        if n < 6:
            return
        d1, d2, d3 = (d[lo:hi + 1] for d in (self.d1, self.d2, self.d3))
        b = self.b[lo:hi + 1].copy()
        cap = np.minimum(np.min((V / np.maximum(np.abs(d1), 1e-12)) ** 2, axis=1), self.feed[lo:hi + 1] ** 2)
        cap = np.maximum(cap, b)
        low = np.zeros(n + 1)
        for end, inner, cell in ((0, 1, 0), (n, n - 1, n - 1)):
            cap[end] = low[end] = b[end]
            if b[end] > 0:
                cap[inner] = low[inner] = b[inner]
            else:
                jerk = np.min(J / np.maximum(np.abs(d1[end]), 1e-12))
                cap[inner] = min(cap[inner], max(b[inner], (jerk / 2) ** 2 * (6 * h[cell] / jerk) ** (4 / 3)))
        rows, cols, values, rhs = [], [], [], []
        count = 0

        def add(c, v, r):
            nonlocal count
            m = len(r)
            rows.append(np.repeat(np.arange(count, count + m)[:, None], len(c), 1).ravel())
            cols.append(np.stack(c, 1).ravel())
            values.append(np.stack(v, 1).ravel())
            rhs.append(r)
            count += m

        i = np.arange(n)
        for k in range(d1.shape[1]):
            for e in (0, 1):
                cu = d1[i + e, k] / (2 * h)
                left, right = -cu.copy(), cu.copy()
                (left, right)[e][:] += d2[i + e, k]
                for sign in (1, -1):
                    add([i, i + 1], [sign * left, sign * right], np.full(n, A[k]))
        jerk_from = count
        m = np.arange(1, n)
        hm = (h[m] + h[m - 1]) / 2
        limits, nodes = [], []
        for k in range(d1.shape[1]):
            q1, q2, q3 = d1[m, k], d2[m, k], d3[m, k]
            before = -(-q1 / hm + 1.5 * q2) / (2 * h[m - 1])
            after = (q1 / hm + 1.5 * q2) / (2 * h[m])
            here = -(q1 / hm + 1.5 * q2) / (2 * h[m]) + (-q1 / hm + 1.5 * q2) / (2 * h[m - 1]) + q3
            for sign in (1, -1):
                add([m - 1, m, m + 1], [sign * before, sign * here, sign * after], np.zeros(n - 1))
                limits.append(np.full(n - 1, J[k]))
                nodes.append(m)
        M = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))), shape=(count, n + 1)).tocsr()
        rhs = np.concatenate(rhs)
        limits, nodes = np.concatenate(limits), np.concatenate(nodes)
        jr = np.arange(jerk_from, count)
        best = time_of(b, h)
        for _ in range(iterations):
            bn = np.maximum(b[nodes], 1e-9)
            r = rhs.copy()
            # J / sqrt(b) is convex: its tangent lies below it.
            r[jr] = 1.5 * limits / np.sqrt(bn)
            D = coo_matrix((0.5 * limits / bn ** 1.5, (jr, nodes)), shape=M.shape).tocsr()
            left = M + D
            # Where the plan is over on this coarse grid, it may stay so.
            r = np.maximum(r, left @ b)
            root = np.sqrt(np.maximum(b, 1e-12))
            part = h / ((root[1:] + root[:-1]) ** 2)
            w = np.zeros(n + 1)
            w[1:] += part / root[1:]
            w[:-1] += part / root[:-1]
            w[low == cap] = 0
            scale = max(np.max(cap), 1e-9)
            upper = np.minimum(cap, 3 * b + 1e-9)
            lower = np.minimum(np.maximum(low, 0.2 * b), upper)
            # Where the simplex method finds no way for want of digits, the interior point method mostly does.
            for method in ('highs', 'highs-ipm'):
                res = linprog(-w / np.max(w), A_ub=left, b_ub=r / scale, bounds=np.c_[lower, upper] / scale, method=method)
                if res.status == 0:
                    break
            else:
                break
            goal = np.clip(res.x * scale, lower, upper)
            found = best
            for part in (1.0, 0.5, 0.25, 0.1):
                t = time_of(b + part * (goal - b), h)
                if t < found:
                    found, better = t, b + part * (goal - b)
                    break
            if found > best * (1 - 1e-5):
                break
            best, b = found, better
        self.b[lo:hi + 1] = b

    def cuts(self, piece, shift):
        """Grid points where the plan is slowest around every `piece` mm."""
        length = self.s[-1]
        places = np.arange(piece * shift, length, piece)
        places = places[(places > 0.25 * piece) & (places < length - 0.25 * piece)]
        found = [0]
        for place in places:
            around = np.flatnonzero(np.abs(self.s - place) < 0.2 * piece)
            if len(around):
                at = int(around[np.argmin(self.b[around])])
                if at - found[-1] > 10:
                    found.append(at)
        if len(self.s) - 1 - found[-1] < 10 and len(found) > 1:
            found.pop()
        return found + [len(self.s) - 1]

    def solve(self, piece):
        for shift in (1.0, 0.5):
            cuts = self.cuts(piece, shift)
            for lo, hi in zip(cuts, cuts[1:]):
                self.improve(lo, hi)
            if len(cuts) == 2:
                break
        return time_of(self.b, np.diff(self.s))


class Derivatives:
    """Looks to topp_vaj like a spline, and answers from the table."""

    def __init__(self, section):
        self.by_order = {1: section.d1, 2: section.d2, 3: section.d3}

    def __call__(self, _):
        return np.zeros(self.by_order[1].shape[1])

    def derivative(self, order):
        return lambda _: self.by_order[order]


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument('smoothed')
    for name in 'vaj':
        ap.add_argument('--' + name, required=True)
    ap.add_argument('--piece', type=float, default=350.0)
    ap.add_argument('--cells', type=int, default=500, help='cells per piece')
    ap.add_argument('--topp')
    o = ap.parse_args()
    with open(o.smoothed) as f:
        header = f.readline().strip().split(',')
    axes = (len(header) - 5) // 4
    table = np.loadtxt(o.smoothed, delimiter=',', skiprows=1, ndmin=2)
    lim = [np.array([float(x) for x in getattr(o, name).split(',')])[:axes] for name in 'vaj']
    topp = None
    if o.topp:
        spec = importlib.util.spec_from_file_location('topp_ref', o.topp)
        topp = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(topp)
    ours = on_grid = reference = 0.0
    sections = np.split(table, np.flatnonzero(np.diff(table[:, 0])) + 1)
    for number, part in enumerate(sections):
        # Points that rounding put onto the same place have no cell between them.
        part = part[np.concatenate([[True], np.diff(part[:, 2]) > 1e-9])]
        if len(part) < 4:
            ours += part[-1, 1] - part[0, 1]
            reference += part[-1, 1] - part[0, 1]
            continue
        section = Section(part, axes, lim)
        pieces = max(1, round(section.s[-1] / o.piece))
        section = section.thinned(o.cells * pieces)
        start = time_of(section.b, np.diff(section.s))
        solved = section.solve(o.piece)
        if topp is not None and pieces == 1 and len(section.s) > 20:
            feed = float(np.min(section.feed))
            _, other, _ = topp.topp_vaj(Derivatives(section), section.s, *lim, feed=feed)
            solved = min(solved, other)
        ours += section.time
        on_grid += start
        reference += solved
        if len(sections) <= 40:
            print(f'section {number}: {section.s[-1]:10.3f} mm, plan {section.time:9.4f} s, on the grid {start:9.4f} s, '
                  f'reference {solved:9.4f} s, ratio {section.time / solved:.4f}', flush=True)
    print(f'{o.smoothed}: {len(sections)} sections, plan {ours:.4f} s, reference {reference:.4f} s, '
          f'ratio {ours / reference:.4f}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
