"""Runs a program with something wrong around it, and says how it ended."""
import ctypes
import dataclasses
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import time

PR_SET_CHILD_SUBREAPER = 36
LONGEST_MESSAGE_BYTES = 500
LINE = re.compile(r"(tsdfpp|info|warning|error): .+")


@dataclasses.dataclass
class Surroundings:
    """What is wrong around a program."""
    variables: dict = dataclasses.field(default_factory=dict)  # of the environment; None takes one away
    empty_environment: bool = False
    limits: dict = dataclasses.field(default_factory=dict)  # of resource.setrlimit
    closed: tuple = ()  # of the descriptors 0, 1, 2
    stdout: str = ""  # a file in place of the one that is read, or "broken pipe"
    ignored: tuple = ()  # signals


@dataclasses.dataclass
class Ending:
    code: int = 0  # where no signal ended it
    signal: int = 0
    out: str = ""
    err: str = ""
    hung: bool = False
    seconds: float = 0.0

    def text(self):
        if self.hung:
            return "did not end"
        return f"was ended by {signal.Signals(self.signal).name}" if self.signal else f"ended with exit code {self.code}"


def adopt_orphans():
    """Children of what is killed become ours, so that we know when all are gone."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def children_of(process):
    """All below it, by /proc."""
    parents = {}
    for name in os.listdir("/proc"):
        if not name.isdigit():
            continue
        try:
            with open(f"/proc/{name}/stat", encoding="utf-8", errors="replace") as file:
                fields = file.read().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(name)] = int(fields[1])
    found, more = [], [process]
    while more:
        of = more.pop()
        for child, parent in parents.items():
            if parent == of:
                found.append(child)
                more.append(child)
    return found


def wait_for_orphans(seconds=10.0):
    """Until all that we started, directly or not, is gone; those that stay are ended and named."""
    end = time.monotonic() + seconds
    while True:
        try:
            while os.waitpid(-1, os.WNOHANG)[0] != 0:
                pass
        except ChildProcessError:
            return []
        left = children_of(os.getpid())
        if not left:
            continue
        if time.monotonic() > end:
            for one in left:
                os.kill(one, signal.SIGKILL)
            return left
        time.sleep(0.002)


class Running:
    """A program that was started, with its own process group."""

    def __init__(self, words, folder, said, around=Surroundings()):
        environment = {} if around.empty_environment else dict(os.environ)
        for name, value in around.variables.items():
            if value is None:
                environment.pop(name, None)
            else:
                environment[name] = value
        self.said = said
        os.makedirs(said, exist_ok=True)
        for name in ("out", "err"):
            open(os.path.join(said, name), "wb").close()

        def prepare():
            for number in around.ignored:
                signal.signal(number, signal.SIG_IGN)
            for kind, value in around.limits.items():
                resource.setrlimit(kind, (value, value))
            for descriptor in around.closed:
                os.close(descriptor)

        pipe = None
        if around.stdout == "broken pipe":
            reader, pipe = os.pipe()
            os.close(reader)
            out = pipe
        else:
            out = os.open(around.stdout or os.path.join(said, "out"), os.O_WRONLY)
        err = os.open(os.path.join(said, "err"), os.O_WRONLY)
        self.begin = time.monotonic()
        # A program that cannot be run is the driver's fault, so Popen may throw.
        self.process = subprocess.Popen(words, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                        start_new_session=True, preexec_fn=prepare)
        os.close(out)
        os.close(err)

    def sleep_until(self, seconds):
        """Since the start; False where it ended before."""
        left = self.begin + seconds - time.monotonic()
        if left <= 0:
            return self.process.poll() is None
        try:
            self.process.wait(left)
            return False
        except subprocess.TimeoutExpired:
            return True

    def send(self, number, to, draw):
        """A signal to the leader, the group or one child (the leader where there is none); says to whom."""
        if to == "child":
            below = sorted(children_of(self.process.pid))
            if below:
                try:
                    os.kill(draw.choice(below), number)
                    return "child"
                except ProcessLookupError:
                    pass
            to = "leader"
        if to == "group":
            os.killpg(self.process.pid, number)
        else:
            os.kill(self.process.pid, number)
        return to

    def end(self, limit_s):
        ending = Ending()
        try:
            self.process.wait(limit_s)
        except subprocess.TimeoutExpired:
            ending.hung = True
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        ending.seconds = time.monotonic() - self.begin
        code = self.process.returncode
        ending.signal, ending.code = (-code, 0) if code < 0 else (0, code)
        ending.out, ending.err = (self.read(name) for name in ("out", "err"))
        return ending

    def read(self, name):
        with open(os.path.join(self.said, name), "rb") as file:
            return file.read().decode(errors="surrogateescape")


def run(words, folder, said, around=Surroundings(), limit_s=120.0):
    ending = Running(words, folder, said, around).end(limit_s)
    wait_for_orphans()
    return ending


def what_is_wrong_with(err):
    """Of what a failing program says: a last line `tsdfpp: ...`, and before it lines of the log alone."""
    lines = err.splitlines()
    if not lines:
        return "it said nothing"
    if not lines[-1].startswith("tsdfpp: "):
        return f"its last line is no sentence of ours: {lines[-1][:120]!r}"
    for line in lines:
        if len(line.encode(errors="surrogateescape")) > LONGEST_MESSAGE_BYTES + len("warning: "):
            return f"it said a line of {len(line)} characters"
        if LINE.fullmatch(line) is None or any(ord(c) < 32 or ord(c) == 127 or 0xd800 <= ord(c) < 0xe000 for c in line):
            return f"it said something that is no line of ours: {line[:120]!r}"
    return ""


def compiled(source, out):
    """A library to be preloaded, made of a C file."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    os.makedirs(os.path.dirname(out), exist_ok=True)
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", out, source, "-ldl"], check=True)
    return out


def peak_of(words, folder, said, limit_s=120.0):
    """Bytes of address space that a program has at most."""
    running, most = Running(words, folder, said), 0
    while running.process.poll() is None and time.monotonic() - running.begin < limit_s:
        for one in [running.process.pid] + children_of(running.process.pid):
            try:
                with open(f"/proc/{one}/status", encoding="utf-8") as file:
                    found = re.search(r"VmPeak:\s+(\d+) kB", file.read())
            except OSError:
                continue
            if found:
                most = max(most, 1024 * int(found[1]))
        time.sleep(0.02)
    running.end(limit_s)
    wait_for_orphans()
    return most


def drawn(seed, *names):
    """Random numbers that depend on these names alone."""
    return random.Random(":".join(map(str, (seed, *names))))
