"""What scripts/faults.py does to a command: learns what it leaves, disturbs it, and judges what is left and what a rerun makes."""
import dataclasses
import os
import shutil
import signal
import sys
import time

import fault_commands
import fault_disk
import fault_process
import fault_trees
from fault_process import Surroundings

SHIM = "tests/kill/shim.c"
CLOCK = "tests/kill/clock_shim.c"
LONGEST_S = 900.0  # of a run that nobody disturbs
# Of what fails: usage, environment, data (docs/command-line.md).
CODES_OF_READERS = (2, 3, 4)


@dataclasses.dataclass
class Outcome:
    """Of one trial."""
    how: str = ""  # killed: what was left: "before", "between", "whole"; a fault: "same", "said", "signal"
    read: int = 0  # readers that read a whole result of what was left
    refused: int = 0  # that said a sentence
    lost: list = dataclasses.field(default_factory=list)


@dataclasses.dataclass
class Learned:
    """Of a command that nobody disturbs."""
    code: int
    before: dict  # contents of its folder (fault_trees.py)
    whole: dict
    stdout: str
    seconds: float
    changes: int  # of its folder, of the process that makes the most
    before_bytes: int
    whole_bytes: int
    peak_bytes: int
    readers: list  # pairs: what each reads of the result before, and of the whole one


class Lab:
    def __init__(self, tsdfpp, work, seed, frames, root=fault_commands.ROOT):
        self.tsdfpp, self.work, self.seed = tsdfpp, work, seed
        shutil.rmtree(work, ignore_errors=True)
        os.makedirs(work)
        self.shim = fault_process.compiled(os.path.join(root, SHIM), self.at("shim.so"))
        self.clock = fault_process.compiled(os.path.join(root, CLOCK), self.at("clock.so"))
        self.inputs = fault_commands.Inputs(tsdfpp, self.at("inputs"), frames)
        self.learned = {}
        begin = time.monotonic()
        self.base_bytes = fault_process.peak_of([tsdfpp, "--version"], work, self.at("said"))
        self.start_s = time.monotonic() - begin

    def at(self, *names):
        return os.path.join(self.work, *names)

    # --- Folders ------------------------------------------------------------------------------------------------------

    def restore(self, command, trial):
        """The folder as it is before the command."""
        os.makedirs(trial, exist_ok=True)
        for name in os.listdir(trial):
            path = os.path.join(trial, name)
            shutil.rmtree(path) if os.path.isdir(path) and not os.path.islink(path) else os.remove(path)
        before = self.at("before", command.name)
        if os.path.isdir(before):
            shutil.copytree(before, trial, symlinks=True, dirs_exist_ok=True)

    def run(self, words, trial, around=Surroundings()):
        return fault_process.run(words, trial, self.at("said"), around, LONGEST_S)

    def limit_s(self, command):
        """What takes longer hangs, on a machine that has other things to do as well."""
        return 120 + 30 * self.learned[command.name].seconds

    # --- Whole runs ---------------------------------------------------------------------------------------------------

    def learn(self, command):
        trial, before = self.at("trial"), self.at("before", command.name)
        self.restore(command, trial)
        if command.given:
            shutil.copytree(command.given, os.path.join(trial, "out"), symlinks=True)
        if command.before:
            ending = self.run(command.before, trial)
            if ending.signal or ending.hung or ending.code not in (0, 1, 4):
                raise RuntimeError(f"{command.name}: what comes before it {ending.text()}: {ending.err.strip()}")
        shutil.copytree(trial, before, symlinks=True)
        before_read = [self.read(words, trial) for words in command.readers]
        runs = []
        count = self.at("changes.txt")
        for shimmed in (False, True):
            self.restore(command, trial)
            around = Surroundings()
            if shimmed and self.shim:
                around.variables = {"LD_PRELOAD": self.shim, "TSDFPP_SHIM_BELOW": trial, "TSDFPP_SHIM_COUNT": count}
            ending = self.run(command.words, trial, around)
            if ending.signal or ending.hung or ending.code not in (0, 1, 4):
                raise RuntimeError(f"{command.name}: {ending.text()}: {ending.err.strip()}")
            runs.append((ending, fault_trees.content_of(trial)))
        (first, content), (second, again) = runs
        for what, one, other in (("files", content, again), ("exit code", first.code, second.code),
                                 ("result", fault_trees.stdout_content(first.out), fault_trees.stdout_content(second.out))):
            if one != other and not (what == "result" and command.writes):
                where = fault_trees.differences(other, one) if what == "files" else ""
                raise RuntimeError(f"{command.name}: two whole runs differ in their {what}: {where}")
        changes = 0
        if os.path.exists(count):
            with open(count, encoding="utf-8", errors="replace") as file:
                changes = max((int(line.split()[0]) for line in file if line.split() and line.split()[0].isdigit()), default=0)
            os.remove(count)
        whole_bytes = fault_disk.bytes_on_disk(trial)
        whole_read = [self.read(words, trial) for words in command.readers]
        if command.readers and all(ending.code or ending.signal for ending, _ in whole_read):
            raise RuntimeError(f"{command.name}: no reader reads the whole result: {whole_read[0][0].err.strip()}")
        peak = 0
        if command.ours:
            self.restore(command, trial)
            peak = fault_process.peak_of(command.words, trial, self.at("said"))
        self.learned[command.name] = Learned(first.code, fault_trees.content_of(before), content,
                                             fault_trees.stdout_content(first.out), first.seconds, changes, fault_disk.bytes_on_disk(before), whole_bytes,
                                             peak, list(zip(before_read, whole_read)))
        return self.learned[command.name]

    # --- What is left -------------------------------------------------------------------------------------------------

    def read(self, words, trial):
        """A reader's ending and what it makes; its folder is removed."""
        place = os.path.join(trial, "read")
        ending = self.run(words, trial)
        made = fault_trees.content_of(place) if os.path.isdir(place) else {}
        shutil.rmtree(place, ignore_errors=True)
        return ending, made

    @staticmethod
    def reads_the_same(one, two):
        (a, made_a), (b, made_b) = one, two
        return (a.code, a.signal, made_a) == (b.code, b.signal, made_b) and \
            (a.code != 0 or fault_trees.stdout_content(a.out) == fault_trees.stdout_content(b.out))

    def judge_left(self, command, trial, outcome):
        """Whether what is left is whole files of one run or of the other, and what its readers make of it."""
        learned = self.learned[command.name]
        if fault_trees.is_part_of_a_run(os.path.join(trial, "out")):
            return "part"
        before, whole = fault_trees.visible(learned.before), fault_trees.visible(learned.whole)
        left = fault_trees.visible(fault_trees.content_of(trial))
        state = "whole" if left == whole else "before" if left == before else "between"
        for path, content in left.items():
            if content not in (before.get(path), whole.get(path)):
                outcome.lost.append(f"{path} is a half-written file, or of neither run" +
                                    (f" ({content})" if content.startswith("broken") else ""))
        # A map's own file (--save) is no part of the run.
        own = [{path: of for path, of in content.items() if path.startswith("out/")} for content in (left, before, whole)]
        if state == "between" and own[0] not in own[1:]:
            there = [name for name in command.notes if os.path.exists(os.path.join(trial, "out", name))]
            if there and not fault_commands.read_notes(os.path.join(trial, "out"), there):
                outcome.lost.append("files of two runs lie side by side, and nothing says so: " +
                                    fault_trees.differences(left, whole))
        for words, (of_before, of_whole) in zip(command.readers, learned.readers):
            found = self.read(words, trial)
            ending = found[0]
            name = " ".join(words[1:3])
            if ending.hung or ending.signal:
                outcome.lost.append(f"'{name}' {ending.text()} on what was left")
            elif self.reads_the_same(found, of_whole) or self.reads_the_same(found, of_before):
                outcome.read += ending.code == 0
                outcome.refused += ending.code != 0
            elif ending.code == 0:
                outcome.lost.append(f"'{name}' read a mixture: it is neither what it reads of one run nor of the other")
            else:
                outcome.refused += 1
            if ending.code and not ending.signal:
                wrong = fault_process.what_is_wrong_with(ending.err)
                if wrong or ending.code not in CODES_OF_READERS:
                    outcome.lost.append(f"'{name}' {ending.text()}: {wrong}")
        return state

    def judge_rerun(self, command, trial, outcome, state):
        """The same command over what is left has to make the whole result, and nothing else."""
        learned = self.learned[command.name]
        ending = self.run(command.words, trial)
        refused = command.done_is_refused and state == "whole" and ending.code == 2 and not ending.signal
        if not refused and (ending.hung or ending.signal or ending.code != learned.code):
            outcome.lost.append(f"the rerun {ending.text()}: {ending.err.strip()[-200:]}")
        found = fault_trees.content_of(trial)
        if found != learned.whole:
            outcome.lost.append("after the rerun " + fault_trees.differences(found, learned.whole))
        if not command.writes and fault_trees.stdout_content(ending.out) != learned.stdout:
            outcome.lost.append("the rerun prints another result")

    # --- Trials -------------------------------------------------------------------------------------------------------

    def moment_s(self, learned, share):
        """Of a command's work, after its start-up."""
        start_s = min(self.start_s, 0.5 * learned.seconds)
        return start_s + share * (learned.seconds - start_s)

    def kill_once(self, command, trial, draw, at_change):
        """False where it ended before."""
        learned = self.learned[command.name]
        to, share = draw.choice(["leader", "leader", "group", "child"]), draw.random()
        if at_change and self.shim and learned.changes > 1:
            variables = {"LD_PRELOAD": self.shim, "TSDFPP_SHIM_BELOW": trial, "TSDFPP_SHIM_HOW": "kill",
                         "TSDFPP_SHIM_AT": str(1 + int(share * learned.changes))}
            ending = fault_process.Running(command.words, trial, self.at("said"), Surroundings(variables)).end(
                self.limit_s(command))
            killed = ending.signal == signal.SIGKILL or (ending.code != learned.code and "signal 9" in ending.err)
        else:
            running = fault_process.Running(command.words, trial, self.at("said"))
            killed = running.sleep_until(self.moment_s(learned, share))
            if killed:
                to = running.send(signal.SIGKILL, to, draw)
            ending = running.end(self.limit_s(command))
        if not killed and not ending.hung:
            learned.seconds = min(learned.seconds, ending.seconds)  # the machine has less to do than it had
        stayed = fault_process.wait_for_orphans()
        return killed, ending, stayed

    def kill(self, command, number, tries=12):
        """One kill at a random moment, judged; nothing where none of the tries met the command at work."""
        trial, learned = self.at("trial"), self.learned[command.name]
        for attempt in range(tries):
            draw = fault_process.drawn(self.seed, command.name, "kill", number, attempt)
            outcome, went_on = Outcome(), False
            self.restore(command, trial)
            for again in range(2 if draw.random() < 0.2 else 1):
                killed, ending, stayed = self.kill_once(command, trial, draw, command.writes and number % 3 == 2)
                if killed:
                    outcome.how = "killed"
                if stayed:
                    outcome.lost.append(f"{len(stayed)} processes stayed")
                if ending.hung:
                    outcome.lost.append("it did not end")
                went_on = bool(command.goes_on) and command.goes_on in ending.out
                if not ending.signal and ending.code != learned.code:
                    # A child was killed, and the command says so.
                    wrong = fault_process.what_is_wrong_with(ending.err)
                    if again == 0 and (wrong or ending.code != 3):
                        outcome.lost.append(f"its child was killed, and it {ending.text()}: {wrong}")
            if outcome.how:
                # A result without what the child would have made is of neither run.
                outcome.how = "between" if went_on else self.judge_left(command, trial, outcome)
                self.judge_rerun(command, trial, outcome, outcome.how)
                return outcome
        return None

    def disturb(self, command, fault, draw, tries=12):
        """One fault, judged; nothing where it cannot be made here."""
        learned = self.learned[command.name]
        for _ in range(tries):
            self.restore(command, self.at("trial"))
            with fault.place(self, command) as disk:
                trial = disk.place if disk else self.at("trial")
                around = fault.around(self, command, draw, trial)
                if around is None:
                    return None
                running = fault_process.Running(command.words + fault.words, trial, self.at("said"), around)
                met = not fault.signal or running.sleep_until(self.moment_s(learned, draw.random()))
                if fault.signal and met:
                    running.send(fault.signal, "leader", draw)
                ending = running.end(self.limit_s(command))
                stayed = fault_process.wait_for_orphans()
                if disk:
                    disk.repair()
                if met:
                    return self.judge_fault(command, fault, trial, ending, stayed)
                learned.seconds = min(learned.seconds, ending.seconds)
        raise RuntimeError(f"{command.name} was never met at work")

    def judge_fault(self, command, fault, trial, ending, stayed):
        learned, outcome = self.learned[command.name], Outcome()
        if stayed:
            outcome.lost.append(f"{len(stayed)} processes stayed")
        if ending.hung:
            outcome.lost.append("it did not end")
        elif ending.signal:
            outcome.how = "signal"
            if ending.signal not in fault.signals:
                outcome.lost.append(f"it {ending.text()}: {ending.err.strip()[-300:]}")
        elif ending.code == learned.code and not fault.must_fail:
            outcome.how = "same"
        else:
            outcome.how = "said"
            wrong = "" if 2 in fault.closed else fault_process.what_is_wrong_with(ending.err)
            if ending.code not in fault.codes:
                outcome.lost.append(f"it {ending.text()}: {ending.err.strip()[-300:]}")
            elif wrong:
                outcome.lost.append(wrong)
        if outcome.how == "same":
            if not command.writes and not fault.closed and not fault.stdout and \
                    fault_trees.stdout_content(ending.out) != learned.stdout:
                outcome.lost.append("it prints another result")
            found = fault_trees.content_of(trial)
            if fault_trees.visible(found) != fault_trees.visible(learned.whole):
                outcome.lost.append("its result differs: " + fault_trees.differences(found, learned.whole))
            elif found != learned.whole:  # a disk that refuses keeps hidden things from being removed
                self.judge_rerun(command, trial, outcome, "whole")
            return outcome
        state = self.judge_left(command, trial, outcome)
        if fault.result_stands and command.writes and state != "whole":
            outcome.lost.append("what it made is not there, though only printing it failed")
        self.judge_rerun(command, trial, outcome, state)
        return outcome

    def pair(self, one, other):
        """Two at the same time in one new folder: what a command made that says 0 is whole, and nothing is a mixture."""
        trial, outcome = self.at("pair"), Outcome()
        shutil.rmtree(trial, ignore_errors=True)
        os.makedirs(trial)
        runnings = [fault_process.Running(command.words, trial, self.at(f"said-{k}")) for k, command in enumerate((one, other))]
        endings = [running.end(self.limit_s(one) + self.limit_s(other)) for running in runnings]
        if fault_process.wait_for_orphans():
            outcome.lost.append("a process stayed")
        left = fault_trees.visible(fault_trees.content_of(trial))
        alone = [self.alone(command) for command in (one, other)]
        for path, content in left.items():
            if content not in (alone[0].get(path), alone[1].get(path)):
                outcome.lost.append(f"{path} is of neither")
        done = []
        for command, ending, made in zip((one, other), endings, alone):
            if ending.hung or ending.signal:
                outcome.lost.append(f"{command.name} {ending.text()}: {ending.err.strip()[-200:]}")
            elif ending.code == self.learned[command.name].code:
                done.append(all(left.get(path) == content for path, content in made.items()))
            elif fault_process.what_is_wrong_with(ending.err) or ending.code not in CODES_OF_READERS:
                outcome.lost.append(f"{command.name} {ending.text()}: {fault_process.what_is_wrong_with(ending.err)}")
        if done and not any(done):
            outcome.lost.append("neither result is whole: " + fault_trees.differences(left, alone[0]))
        if done and not all(done) and not self.may_replace(one, other):
            outcome.lost.append("both went well, and one of the results is not whole: " + fault_trees.differences(left, alone[0]))
        outcome.how = ("both" if len(done) == 2 else "one" if done else "neither")
        return outcome

    def alone(self, command):
        """What a command makes of nothing."""
        kept = getattr(self, "kept_alone", None)
        if kept is None:
            kept = self.kept_alone = {}
        if command.name not in kept:
            trial = self.at("pair-alone")
            shutil.rmtree(trial, ignore_errors=True)
            os.makedirs(trial)
            ending = self.run(command.words, trial)
            if ending.code != self.learned[command.name].code or ending.signal:
                raise RuntimeError(f"{command.name} alone {ending.text()}: {ending.err.strip()}")
            kept[command.name] = fault_trees.visible(fault_trees.content_of(trial))
        return kept[command.name]

    @staticmethod
    def may_replace(one, other):
        """A run that comes after another may take its place (docs/command-line.md)."""
        return bool(one.replaces and other.replaces)


if __name__ == "__main__":
    sys.exit("run scripts/faults.py")
