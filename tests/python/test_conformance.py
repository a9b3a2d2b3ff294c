"""The suite of worlds on the engines that people start from, and on MuJoCo: within the tolerances that they declare."""

import concurrent.futures
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from rtbus.session import find_program

TREE = Path(__file__).resolve().parents[2]
BUILT = Path(find_program()).parent
# python3 in their files is the interpreter of this test, own_engine the one of this build.
PATHS = os.pathsep.join([str(Path(sys.executable).parent), str(BUILT), os.environ["PATH"]])


def conformance(file):
    """Checks of one engine: (those that failed, how many there are, what was noted); None: this machine was too busy."""
    with tempfile.TemporaryDirectory() as folder:
        command = [find_program(), "conformance", str(TREE / file), "--json", "--out", folder]
        out = subprocess.run(command, capture_output=True, text=True, timeout=300, env={**os.environ, "PATH": PATHS})
    if not out.stdout:
        raise AssertionError(out.stderr)
    summary = json.loads(out.stdout)
    if any(each["verdict"] == "machine_too_busy" for each in summary["checks"]):
        return None
    failed = [f"{each['id']}: {each['value']} {each['unit']}" for each in summary["checks"] if not each["pass"]]
    return failed, len(summary["checks"]), str(summary.get("notes"))


class Conformance(unittest.TestCase):
    def test_engines_are_as_exact_as_they_declare(self):
        engines = {"docs/examples/python/python_wall_engine.yaml": 30, "docs/examples/own_engine_engine.yaml": 20}
        if (BUILT / "mujoco_engine").exists():
            engines["config/engines/mujoco.yaml"] = 50
        with concurrent.futures.ThreadPoolExecutor() as pool:
            found = dict(zip(engines, pool.map(conformance, engines)))
        for file, least in engines.items():
            with self.subTest(engine=file):
                if found[file] is None:
                    self.skipTest("this machine paused for more than 80 ms, again and again")
                failed, checks, said = found[file]
                print(f"{file}: {checks} checks")
                self.assertEqual(failed, [], said)
                self.assertGreaterEqual(checks, least)


if __name__ == "__main__":
    unittest.main()
