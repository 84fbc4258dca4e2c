#!/usr/bin/env python3
"""Removes the guards of `mutations.toml` one by one in a copy of the repository, and requires that a test fails each time.

    python3 tests/mutations/run.py                        # all 298
    python3 tests/mutations/run.py --only dilation        # those whose name begins with a word; several words may follow
    python3 tests/mutations/run.py --check                # only: is every text to be replaced still there, once?

Prints a table: guard, mutation, tests that failed. Exit code 1 if a mutation survives, does not compile, or its text is not found once.
The unchanged tests have to pass, which is not looked at. Nothing in the repository is written to: the copy is `target/mutations`,
or `--work DIRECTORY`, and is kept, so that a second run compiles less. $CARGO may name another cargo. Needs Python 3.11, git and cargo.
"""

import argparse
import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
# A mutation may make a test run for ever; the first one builds everything.
SECONDS = 1200


def repository_files():
    """What git knows of, and what is new but not ignored."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True
    )
    names = {name for name in listed.stdout.decode().split("\0") if name}
    return sorted(name for name in names if (ROOT / name).is_file())


def copy_repository(to):
    """Brings the copy up to date; files that are already alike keep their times, so that cargo does not build them again."""
    kept = set()
    for name in repository_files():
        source, target = ROOT / name, to / name
        kept.add(target)
        data = source.read_bytes()
        if not target.is_file() or target.read_bytes() != data:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
    # A test target that is gone from the repository would still be built.
    for old in to.glob("**/*.rs"):
        if old not in kept and to / "target" not in old.parents:
            old.unlink()


def cargo_test(arguments, work):
    """Runs cargo in the copy; returns its exit code, or None if it took too long, and all that it said."""
    environment = dict(
        os.environ,
        CARGO_TARGET_DIR=str(work / "target"),
        CARGO_TERM_COLOR="never",
        # A counterexample need not be small, nor be kept.
        PROPTEST_MAX_SHRINK_ITERS="0",
        PROPTEST_FAILURE_PERSISTENCE="off",
        RUST_BACKTRACE="0",
    )
    command = [os.environ.get("CARGO", "cargo"), "test", "--no-fail-fast", *arguments]
    # A session of its own, so that the tests that cargo started end with it.
    process = subprocess.Popen(
        command, cwd=work, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )
    try:
        said, _ = process.communicate(timeout=SECONDS)
        return process.returncode, said.decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said, _ = process.communicate()
        return None, said.decode(errors="replace")


def outcome(mutation, work):
    """Whether the mutation was found, and by what."""
    code, said = cargo_test(mutation["test"].split(), work)
    if code is None:
        return True, "a test that does not end"
    if "could not compile" in said or "running" not in said:
        errors = [line for line in said.splitlines() if line.startswith("error")] or said.splitlines()[-1:]
        return False, "DOES NOT COMPILE: " + " ".join(errors[:2])
    failed = sorted(set(re.findall(r"^test (\S+) .*\bFAILED$", said, re.MULTILINE)))
    # With --nocapture or an abort the line of a test is broken up.
    failed = failed or sorted(set(re.findall(r"^    (\S+)$", said.split("\nfailures:\n")[-1], re.MULTILINE)))
    if code == 0:
        ran = sum(int(n) for n in re.findall(r"^running (\d+) tests?$", said, re.MULTILINE))
        return False, "SURVIVED" if ran else "SURVIVED: NO TEST RAN"
    return True, ", ".join(f"`{name}`" for name in failed) or f"exit code {code}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="run mutations whose names begin so")
    parser.add_argument("--check", action="store_true", help="only check that every text is found once")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "target" / "mutations", help="the copy")
    given = parser.parse_args()

    with open(HERE / "mutations.toml", "rb") as file:
        mutations = tomllib.load(file)["mutation"]
    names = [m["name"] for m in mutations]
    wrong = [f"{name}: the name is used twice" for name in sorted({n for n in names if names.count(n) > 1})]
    for m in mutations:
        count = (ROOT / m["file"]).read_text().count(m["old"])
        if count != 1:
            wrong.append(f"{m['name']}: its text is {count} times in {m['file']}, not once")
    for complaint in wrong:
        print(complaint, file=sys.stderr)
    if wrong or given.check:
        return 1 if wrong else 0
    if given.only:
        mutations = [m for m in mutations if m["name"].startswith(tuple(given.only))]
    if not mutations:
        print("no mutation has such a name", file=sys.stderr)
        return 1

    work = given.work.resolve()
    copy_repository(work)
    print("| name | guard | removed as | tests that failed | seconds |\n| --- | --- | --- | --- | --- |", flush=True)
    survivors = []
    for m in mutations:
        path = work / m["file"]
        whole = path.read_text()
        start = time.monotonic()
        try:
            path.write_text(whole.replace(m["old"], m["new"]))
            found, what = outcome(m, work)
        finally:
            path.write_text(whole)
        seconds = time.monotonic() - start
        print(f"| `{m['name']}` | {m['guard']} | {m['as']} | {what} | {seconds:.0f} |", flush=True)
        if not found:
            survivors.append(m["name"])
    print(f"\n{len(mutations) - len(survivors)} of {len(mutations)} mutations were found")
    if survivors:
        print(f"not found: {', '.join(survivors)}", file=sys.stderr)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
