"""What our programs' own --help says they can do."""
import functools
import os
import re
import subprocess
import unittest


def options_of(program, *command):
    """Every option of the program that the environment names so."""
    done = subprocess.run([os.environ[program], *command, "--help"], capture_output=True, text=True, check=True)
    return set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", done.stdout))


def keeps_state(test):
    """The jobs of docker/farm name --state; a client that was built without it cannot carry them out."""

    @functools.wraps(test)
    def checked(self):
        if "--state" not in options_of("RADIOSITY", "solve"):
            raise unittest.SkipTest("this `radiosity solve` has no --state")
        test(self)

    return checked
