#!/usr/bin/env python3
"""scripts/faults.py on programs that are planted here: what is lost is found, and what is sound is not."""
import os
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
import fault_commands  # noqa: E402
import fault_lab  # noqa: E402
import fault_process  # noqa: E402
import fault_trees  # noqa: E402
import faults  # noqa: E402

# Writes two files; HOW says how. What reads them expects two of one run.
WRITER = '''
import os, sys, time
how, run = sys.argv[1], sys.argv[2]
if how == "crash" and os.environ.get("TSDFPP_CLOCK"):
    os.abort()
os.makedirs("out", exist_ok=True)
def put(name, text):
    place = os.path.join("out", name)
    part = place if how == "half" else "out/." + name + (str(os.getpid()) if how == "litter" else "") + ".part"
    with open(part, "w") as file:
        file.write(text[:5])
        file.flush()
        time.sleep(0.1)
        file.write(text[5:])
    if part != place:
        os.replace(part, place)
try:
    if how != "mixture" and os.path.exists("out/b"):
        os.remove("out/b")
    for name in "ab":
        put(name, name + " of the run " + run)
    print("done")
    sys.stdout.flush()
except OSError as error:
    if how != "silent":
        print("tsdfpp: it went wrong (%s)" % error, file=sys.stderr)
    os._exit(3)
'''
READER = '''
import sys
try:
    print(open("out/a").read()[1:], open("out/b").read()[1:])
except OSError:
    print("tsdfpp: there is no whole result", file=sys.stderr)
    sys.exit(4)
'''


class Planted(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        fault_process.adopt_orphans()
        self.lab = fault_lab.Lab(sys.executable, os.path.join(self.folder.name, "work"), 1, 4)
        self.lab.start_s = 0.0

    def command(self, how, **more):
        def words(run):
            return [sys.executable, "-c", WRITER, how, run]
        command = fault_commands.Command(how, words("new"), before=words("old"), readers=[[sys.executable, "-c", READER]], **more)
        self.lab.learn(command)
        return command

    def lost_by_kills(self, how, kills=range(6)):
        command = self.command(how)
        outcomes = [self.lab.kill(command, k) for k in kills]
        return [sentence for outcome in outcomes if outcome for sentence in outcome.lost], outcomes

    def lost_by(self, command, name):
        fault = next(fault for fault in faults.faults() if fault.name == name)
        outcome = self.lab.disturb(command, fault, fault_process.drawn(1, name))
        if outcome is None:
            self.skipTest("needs a C compiler")
        return outcome

    def test_a_sound_program_loses_nothing(self):
        lost, outcomes = self.lost_by_kills("sound")
        self.assertEqual(lost, [])
        self.assertIn("between", [outcome.how for outcome in outcomes if outcome])

    def test_half_a_file_is_found(self):
        self.assertTrue(any("half-written" in sentence for sentence in self.lost_by_kills("half")[0]))

    def test_a_mixture_is_found(self):
        # Each third kill comes at a change of the folder: the moment between the two files, whatever else the machine does.
        kills = range(2, 20, 3) if self.lab.shim else range(24)
        self.assertTrue(any("mixture" in sentence for sentence in self.lost_by_kills("mixture", kills)[0]))

    def test_litter_is_found(self):
        self.assertTrue(any("too much" in sentence for sentence in self.lost_by_kills("litter")[0]))

    def test_a_crash_is_found(self):
        outcome = self.lost_by(self.command("crash"), "the time of day jumps: both")
        self.assertTrue(any("SIGABRT" in sentence for sentence in outcome.lost))

    def test_silence_is_found(self):
        full = "every change fails from a random one on: disk full"
        self.assertTrue(any("said nothing" in one for one in self.lost_by(self.command("silent"), full).lost))
        self.assertEqual(self.lost_by(self.command("sound"), full).lost, [])

    def test_a_result_that_cannot_be_printed_has_to_be_said(self):
        # Python says it at the end, in its own words.
        self.assertTrue(self.lost_by(self.command("sound"), "stdout is closed").lost)

    def test_the_plan_is_the_seed_s(self):
        draws = [fault_process.drawn(seed, "map", "kill", 3).random() for seed in (1, 1, 2)]
        self.assertEqual(draws[0], draws[1])
        self.assertNotEqual(draws[0], draws[2])

    def test_all_kills_are_given_out(self):
        commands = [fault_commands.Command(str(k), [], kills=k) for k in range(1, 6)]
        self.assertEqual(sum(faults.kills_of(commands, 15).values()), 15)
        self.assertEqual(sum(faults.kills_of(commands, 10).values()), 10)

    def test_times_and_names_of_runs_are_aside_and_nothing_else(self):
        def json_of(text):
            return fault_trees.content_of_file("out/stats.json", text.encode())
        one = '{"run": "0123456789abcdef", "times": {"fuse": 1.5}, "frames": 4}'
        self.assertEqual(json_of(one), json_of(one.replace("1.5", "2.5").replace("cdef", "cdee")))
        self.assertNotEqual(json_of(one), json_of(one.replace("4}", "5}")))
        self.assertTrue(json_of(one[:-1]).startswith("broken"))
        rows = "frame,kept,mesh_s\n1,0.5,0.1\n"
        self.assertEqual(fault_trees.content_of_file("frames.csv", rows.encode()),
                         fault_trees.content_of_file("frames.csv", rows.replace("0.1", "0.2").encode()))
        self.assertTrue(fault_trees.content_of_file("frames.csv", rows[:-1].encode()).startswith("broken"))


if __name__ == "__main__":
    unittest.main()
