#!/usr/bin/env python3
"""What a program is made of: scripts/package/bill.py CRATE VERSION BILL LICENCES [OPTIONS OF CARGO TREE].

In:  Cargo.lock; the crates' manifests and files of licences, as cargo has fetched them.
Out: BILL, a CycloneDX 1.5 document; LICENCES, the text of each licence once, with the crates that it is of.
"""
import json
import pathlib
import re
import subprocess
import sys

crate, version, bill, licences, *options = sys.argv[1:]
TARGET = "x86_64-unknown-linux-gnu"
root = pathlib.Path(__file__).resolve().parent.parent.parent


def cargo(*words):
    done = subprocess.run(["cargo", *words], cwd=root, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


tree = cargo("tree", "--locked", "-p", crate, "-e", "normal", "--target", TARGET, "--prefix", "none", "--no-dedupe", *options)
linked = {tuple(line.split()[:2]) for line in tree.splitlines()}
metadata = json.loads(cargo("metadata", "--locked", "--format-version", "1", "--filter-platform", TARGET))
packages = {p["id"]: p for p in metadata["packages"] if (p["name"], "v" + p["version"]) in linked}
packages = dict(sorted(packages.items(), key=lambda item: (item[1]["name"], item[1]["version"])))


def reference(package):
    return f"pkg:cargo/{package['name']}@{package['version']}"


def expression(package):
    """The licence as SPDX writes it; `/` is how cargo once wrote OR."""
    return package["license"].strip().replace("/", " OR ")


def component(package):
    kind = "application" if package["name"] == crate else "library"
    one = {"type": kind, "bom-ref": reference(package), "name": package["name"], "version": package["version"]}
    if package["source"]:
        one["purl"] = reference(package)
    one["licenses"] = [{"expression": expression(package)}]
    return one


rust = subprocess.run(["rustc", "--version"], check=True, stdout=subprocess.PIPE, text=True).stdout.split()[1]
std = {"type": "library", "bom-ref": f"rust-std@{rust}", "name": "rust-std", "version": rust}
std["licenses"] = [{"expression": "MIT OR Apache-2.0"}]
mine = next(p for p in packages.values() if p["name"] == crate)
depends = []
for node in metadata["resolve"]["nodes"]:
    if node["id"] in packages:
        on = [d["pkg"] for d in node["deps"] if d["pkg"] in packages and any(k["kind"] is None for k in d["dep_kinds"])]
        depends.append({"ref": reference(packages[node["id"]]), "dependsOn": sorted(reference(packages[p]) for p in on)})
document = {
    "bomFormat": "CycloneDX",
    "specVersion": "1.5",
    "version": 1,
    "metadata": {"component": {**component(mine), "version": version}},
    "components": [std, *(component(p) for p in packages.values() if p is not mine)],
    "dependencies": sorted(depends, key=lambda one: one["ref"]),
}
pathlib.Path(bill).write_text(json.dumps(document, indent=1) + "\n")

# Where a crate has no file of its licence, the text is that which its manifest names, as this project has it.
OWN = {"MIT": "LICENSE-MIT", "Apache-2.0": "LICENSE-APACHE"}
texts = {}
for package in packages.values():
    folder = pathlib.Path(package["manifest_path"]).parent if package["source"] else root
    names = re.compile(r"(licen[cs]e|copying|copyright|notice|unlicense)", re.IGNORECASE)
    files = sorted(f for f in folder.iterdir() if names.match(f.name) and f.is_file())
    if not files:
        named = re.split(r"\W+(?:OR|AND)\W+", expression(package))
        files = [root / OWN[name] for name in named if name in OWN][:1]
    if not files:
        sys.exit(f"{package['name']} {package['version']}: no file of its licence, {expression(package)}")
    for file in files:
        text = file.read_text(errors="replace").strip()
        texts.setdefault(text, []).append(f"{package['name']} {package['version']} ({expression(package)})")
with open(licences, "w", encoding="utf-8") as out:
    out.write(f"{crate} {version}: licences of what is in it. Each crate is used under one of those that its line names.\n")
    for text, crates in texts.items():
        out.write("\n" + "=" * 78 + "\n" + "\n".join(dict.fromkeys(crates)) + "\n\n" + text + "\n")
