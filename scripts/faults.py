#!/usr/bin/env python3
"""Kills every command of tsdfpp at work, and takes from it what it needs: disk, memory, files, time, an output, the folder.

    python3 scripts/faults.py [--out out/faults] [--tsdfpp build/release/tsdfpp] [--seed N] [--only PATTERN ...] [--quick]

Each command is run whole first, over an older result. Then 200 times one is killed at a random moment, after its start-up:
the process, its group or a child; or, a third of them, at a random change of its folder (tests/kill/shim.c). What is left
must be whole files of the older run or of the new one; what reads it says a sentence or reads one whole result; and the same
command over it makes, byte for byte, the result of the run that nobody disturbed. Left aside are times and a run's name
(fault_trees.py, ASIDE). Then each command meets each fault of the list below, and each two that write meet in one folder.

The same seed makes the same plan. OUT/faults.json has the figures, OUT/faults.txt a line a trial. Exit code 1: something was
lost. As root, disks are small file systems in memory, in a mount namespace of our own; other users' faults of disks are those
of the shim. --quick is what a build's tests run: 10 kills and a few faults of a few commands.
"""
import argparse
import contextlib
import datetime
import fnmatch
import itertools
import json
import os
import resource
import shutil
import signal
import subprocess
import sys

sys.dont_write_bytecode = True
import fault_commands  # noqa: E402
import fault_disk  # noqa: E402
import fault_lab  # noqa: E402
import fault_process  # noqa: E402
from fault_process import Surroundings  # noqa: E402

OWN_MOUNTS = "TSDFPP_FAULTS_OWN_MOUNTS"
LOCALES = {"de_DE": "comma for the decimal point", "tr_TR": "i without its dot"}


class Fault:
    """Something wrong around a command, and how it may end then: well, with the same bytes, if nothing else is said."""

    def __init__(self, name, writers=False, codes=(), signals=(), number=0, words=(), disk=None, times=1, closed=(), stdout="",
                 result_stands=False, must_fail=False, quick=False, around=None):
        self.name, self.writers, self.codes, self.signals, self.signal = name, writers, codes, signals, number
        self.words, self.disk, self.times, self.closed, self.stdout = list(words), disk, times, closed, stdout
        self.result_stands, self.must_fail, self.quick, self.make = result_stands, must_fail, quick, around

    def place(self, lab, command):
        return fault_disk.OnADisk(lab, command, **self.disk) if self.disk else contextlib.nullcontext()

    def around(self, lab, command, draw, trial):
        if self.make:
            return self.make(lab, command, draw, trial)
        return Surroundings(closed=self.closed, stdout=self.stdout)

    def why_not(self, lab):
        """Why it cannot be made on this machine; empty where it can."""
        if self.disk and not os.environ.get(OWN_MOUNTS):
            return "needs root, to mount file systems"
        return ""


def shimmed(how):
    def make(lab, command, draw, trial):
        changes = lab.learned[command.name].changes
        if lab.shim is None or changes < 1:
            return None
        return Surroundings({"LD_PRELOAD": lab.shim, "TSDFPP_SHIM_BELOW": trial, "TSDFPP_SHIM_HOW": how,
                             "TSDFPP_SHIM_AT": str(draw.randint(1, changes))})
    return make


def memory(share):
    def make(lab, command, draw, trial):
        peak = lab.learned[command.name].peak_bytes
        return Surroundings(limits={resource.RLIMIT_AS: int(lab.base_bytes + share * (peak - lab.base_bytes))})
    return make


def file_size(ignored):
    def make(lab, command, draw, trial):
        largest = max((os.path.getsize(os.path.join(base, name)) for base, _, names in os.walk(trial) for name in names),
                      default=100000)
        return Surroundings(limits={resource.RLIMIT_FSIZE: int(largest * draw.uniform(0.05, 0.6)) + 100},
                            ignored=(signal.SIGXFSZ,) if ignored else ())
    return make


def clock(how):
    return lambda lab, command, draw, trial: Surroundings({"LD_PRELOAD": lab.clock, "TSDFPP_CLOCK": how}) if lab.clock else None


def locale(name):
    def make(lab, command, draw, trial):
        place = lab.at("locales")
        if not os.path.isdir(os.path.join(place, name + ".utf8")):
            os.makedirs(place, exist_ok=True)
            if shutil.which("localedef") is None:
                return None
            subprocess.run(["localedef", "-i", name, "-f", "UTF-8", os.path.join(place, name + ".utf8")], check=False,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # warnings are exit code 1
            if not os.path.isdir(os.path.join(place, name + ".utf8")):
                return None
        return Surroundings({"LOCPATH": place, "LC_ALL": name + ".utf8"})
    return make


def surroundings(**settings):
    return lambda lab, command, draw, trial: Surroundings(**settings)


def faults():
    # What a full disk leaves to be said: docs/command-line.md has the exit codes.
    disk, ended = (3,), [("SIGTERM", signal.SIGTERM), ("SIGINT", signal.SIGINT), ("SIGHUP", signal.SIGHUP)]
    return [
        *[Fault(f"disk full: {share:.0%} of what is needed is free", True, disk, disk={"free_share": share}, quick=share == 0.5)
          for share in (0.05, 0.5, 0.9)],
        Fault("no more files on the disk: half of what is needed", True, disk, disk={"files_share": 0.5}),
        Fault("read-only disk", True, disk, disk={"read_only": True}, must_fail=True),
        Fault("every change fails from a random one on: disk full", True, disk, around=shimmed("ENOSPC"), times=2, quick=True),
        Fault("every change fails from a random one on: input/output error", True, disk, around=shimmed("EIO"), times=2),
        Fault("every change fails from a random one on: read-only", True, disk, around=shimmed("EROFS")),
        Fault("largest file limited (ulimit -f)", True, disk, (signal.SIGXFSZ,), around=file_size(False)),
        Fault("largest file limited, its signal ignored", True, disk, around=file_size(True)),
        *[Fault(f"memory limited (ulimit -v): {share:.0%} between start-up's and all that it uses", codes=(3,),
                around=memory(share), quick=share == 0.5) for share in (0.1, 0.3, 0.5, 0.7, 0.9)],
        Fault("24 open files at most (ulimit -n)", codes=(3, 4), around=surroundings(limits={resource.RLIMIT_NOFILE: 24})),
        *[Fault(f"the time of day jumps: {how}", around=clock(how), quick=how == "both") for how in ("back", "forward", "both")],
        *[Fault(f"{n} thread{'s' if n > 1 else ''}", words=["--threads", str(n)]) for n in (1, 2, 8)],
        *[Fault(f"locale {name}: {what}", around=locale(name)) for name, what in LOCALES.items()],
        Fault("no HOME, TMPDIR elsewhere", around=surroundings(variables={"HOME": None, "TMPDIR": "/nowhere"})),
        Fault("empty environment", around=surroundings(empty_environment=True)),
        *[Fault(name + " at a random moment", codes=(3,), signals=(number,), number=number, quick=name == "SIGTERM")
          for name, number in ended],
        Fault("stdout is a broken pipe", codes=(3,), signals=(signal.SIGPIPE,), stdout="broken pipe", result_stands=True),
        Fault("stdout is full", codes=(3,), stdout="/dev/full", result_stands=True, must_fail=True, quick=True),
        Fault("stdout is closed", codes=(3,), closed=(1,), result_stands=True, must_fail=True),
        Fault("stderr is closed", closed=(2,)),
        Fault("stdin is closed", closed=(0,)),
        Fault("stdin, stdout and stderr are closed", codes=(3,), closed=(0, 1, 2), result_stands=True, must_fail=True, quick=True),
    ]


class Record:
    """The figures, and a line a trial."""

    def __init__(self, out, seed):
        self.figures = {"schema": 1, "seed": seed, "kills": {}, "faults": {}, "pairs": {}, "not_tried": {}, "lost": [],
                        "order": [fault.name for fault in faults()]}
        self.log = open(os.path.join(out, "faults.txt"), "w", encoding="utf-8")

    def add(self, kind, name, what, outcome):
        line = self.figures[kind].setdefault(name, {}).setdefault(what, {"tried": 0, "survived": 0, "lost": 0})
        line["tried"] += 1
        line["lost" if outcome.lost else "survived"] += 1
        line[outcome.how] = line.get(outcome.how, 0) + 1
        for reader in ("read", "refused"):
            if getattr(outcome, reader):
                line[reader] = line.get(reader, 0) + getattr(outcome, reader)
        text = f"{name}: {what}: {outcome.how}" + "".join(f"; LOST: {one}" for one in outcome.lost)
        print(text, file=self.log, flush=True)
        if outcome.lost:
            print(text, flush=True)
            self.figures["lost"].append({"command": name, "fault": what, "what": outcome.lost})

    def write(self, out):
        # The record is kept with the sources, where no folder of a machine belongs.
        for one in self.figures["lost"]:
            one["what"] = [text.replace(os.path.abspath(out), "OUT") for text in one["what"]]
        with open(os.path.join(out, "faults.json"), "w", encoding="utf-8") as file:
            json.dump(self.figures, file, indent=1)
            file.write("\n")


def kills_of(commands, total):
    """As many of each as it has; fewer in all in proportion, but one of each at least."""
    every = sum(command.kills for command in commands)
    if total >= every:
        return {command.name: command.kills for command in commands}
    share = {command.name: max(1, command.kills * total // every) for command in commands}
    most = max(share, key=share.get)
    share[most] += max(0, total - sum(share.values()))
    return share


def parts_of(commands, options):
    """What is chosen."""
    chosen = [command for command in commands if (command.quick or not options.quick) and
              (not options.only or any(fnmatch.fnmatchcase(command.name, pattern) for pattern in options.only))]
    kinds = [fault for fault in faults() if fault.quick or not options.quick]
    if options.faults:
        kinds = [fault for fault in kinds if any(fnmatch.fnmatchcase(fault.name, pattern) for pattern in options.faults)]
    return chosen, kinds


def run_all(lab, options, record):
    lab.inputs.make(options.quick)
    record.figures["version"] = lab.inputs.program
    chosen, kinds = parts_of(fault_commands.commands_of(lab.inputs), options)
    for command in chosen:
        learned = lab.learn(command)
        print(f"{command.name}: {learned.seconds:.2f} s, {len(learned.whole)} files, {learned.changes} changes", flush=True)
    if "kills" in options.parts:
        for name, count in kills_of(chosen, options.kills).items():
            command = next(one for one in chosen if one.name == name)
            for k in range(count):
                outcome = lab.kill(command, k)
                if outcome is None:
                    sys.exit(f"faults: {name} was never met at work")
                record.add("kills", name, "SIGKILL", outcome)
            record.write(options.out)
    if "faults" in options.parts:
        for fault in kinds:
            why = fault.why_not(lab)
            if why:
                record.figures["not_tried"][fault.name] = why
                continue
            some = [one for one in chosen if one.ours and (one.writes if fault.writers else not one.variant)]
            for command in some[1:3] if options.quick else some:
                for k in range(fault.times):
                    outcome = lab.disturb(command, fault, fault_process.drawn(lab.seed, command.name, fault.name, k))
                    if outcome:
                        record.add("faults", command.name, fault.name, outcome)
                    else:
                        record.figures["not_tried"].setdefault(fault.name, "this machine lacks what makes it")
            record.write(options.out)
    if "pairs" in options.parts and not options.quick:
        for one, other in itertools.combinations_with_replacement([one for one in chosen if one.pairs], 2):
            record.add("pairs", one.name, other.name, lab.pair(one, other))
    record.write(options.out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="out/faults", metavar="OUT")
    parser.add_argument("--tsdfpp", default="build/release/tsdfpp", metavar="PROGRAM")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--frames", type=int, default=12, help="of the small scene")
    parser.add_argument("--only", nargs="+", metavar="PATTERN", help="of commands")
    parser.add_argument("--faults", nargs="+", metavar="PATTERN", help="of faults")
    parser.add_argument("--parts", nargs="+", default=["kills", "faults", "pairs"], choices=["kills", "faults", "pairs"])
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    if options.quick:
        options.kills = min(options.kills, 10)
    if os.geteuid() == 0 and not os.environ.get(OWN_MOUNTS) and shutil.which("unshare") and \
            subprocess.run(["unshare", "--mount", "true"], check=False, stderr=subprocess.DEVNULL).returncode == 0:
        os.environ[OWN_MOUNTS] = "1"
        os.execvp("unshare", ["unshare", "--mount", sys.executable, os.path.abspath(__file__), *sys.argv[1:]])
    os.makedirs(options.out, exist_ok=True)
    fault_process.adopt_orphans()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("faults: stopped"))
    record = Record(options.out, options.seed)
    lab = fault_lab.Lab(os.path.abspath(options.tsdfpp), os.path.abspath(os.path.join(options.out, "work")), options.seed,
                        options.frames)
    record.figures["date"] = datetime.date.today().isoformat()
    try:
        run_all(lab, options, record)
    except RuntimeError as error:
        sys.exit(f"faults: {error}")
    finally:
        fault_process.wait_for_orphans(0)
    tried = sum(line["tried"] for kind in ("kills", "faults", "pairs") for of in record.figures[kind].values()
                for line in of.values())
    print(f"{tried} tried, {len(record.figures['lost'])} lost; {options.out}/faults.json")
    if tried == 0:
        sys.exit("faults: nothing was tried")
    shutil.rmtree(lab.work)
    return 1 if record.figures["lost"] else 0


if __name__ == "__main__":
    sys.exit(main())
