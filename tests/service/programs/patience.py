"""How much longer tests wait where everything is slower, as it is under a sanitizer."""
import os

#: What every wait is multiplied by that is there to end a test which hangs; CMakePresets.json sets it for the sanitizers. What
#: the programs promise, "within five seconds" say, is not.
PATIENCE = max(1, int(os.environ.get("RADIOSITY_TEST_PATIENCE") or "1"))
