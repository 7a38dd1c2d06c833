"""The harness itself: what a sanitizer says of a server fails the test, whether or not anybody looks at the server's end."""
import os
import stat
import unittest
import unittest.mock

from harness import ServiceCase

# Says where it listens, then what a sanitizer would, then waits to be killed.
SERVER = """#!/bin/sh
{complains}
echo listening on http://127.0.0.1:1/
exec sleep 60
"""
INTO_ITS_FILE = """echo "ERROR: AddressSanitizer: heap-use-after-free" > "${ASAN_OPTIONS##*log_path=}.$$" """
TO_STANDARD_ERROR = "echo 'solver.cpp:1:2: runtime error: signed integer overflow' >&2"


class HarnessTest(unittest.TestCase):
    def outcome(self, complains):
        """Result of a test that starts such a server and asks nothing of it."""

        class Careless(ServiceCase):
            def runTest(self):
                program = self.folder / "server"
                program.write_text(SERVER.replace("{complains}", complains))
                program.chmod(stat.S_IRWXU)
                with unittest.mock.patch.dict(os.environ, {"RADIOSITYD": str(program)}):
                    self.server()

        result = unittest.TestResult()
        with unittest.mock.patch.dict(os.environ, {"ASAN_OPTIONS": "exitcode=99"}):
            Careless().run(result)
        self.assertEqual(result.errors, [])
        return result

    def test_aServerOfWhichNothingIsSaidIsFine(self):
        self.assertEqual(self.outcome("").failures, [])

    def test_aReportInItsFileFailsTheTest(self):
        (_, why), = self.outcome(INTO_ITS_FILE).failures
        self.assertIn("heap-use-after-free", why)

    def test_aReportOnStandardErrorFailsTheTest(self):
        (_, why), = self.outcome(TO_STANDARD_ERROR).failures
        self.assertIn("signed integer overflow", why)


if __name__ == "__main__":
    unittest.main()
