"""Holds protocol/README.md against the sources, name by name and number by number: a client is written from it alone, so
what one of them has the other must have, and a test must mention it."""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MIB = 1 << 20


def read(*parts):
    return ROOT.joinpath(*parts).read_text(encoding="utf-8")


SPECIFICATION = read("protocol", "README.md")
TESTS = "\n".join(path.read_text(encoding="utf-8") for ending in ("*.cpp", "*.h", "*.py", "*.ts")
                  for path in sorted((ROOT / "tests").rglob(ending)) if path != Path(__file__).resolve())


def section(title):
    return re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", SPECIFICATION, re.MULTILINE | re.DOTALL).group(1)


def first_cells(title):
    """First cells of a section's first table, header and rule left out."""
    rows = re.findall(r"^\| (.*?) \|", section(title), re.MULTILINE)
    return rows[1:]


def quoted(text):
    return set(re.findall(r"`([^`]+)`", text))


def structs_of(header):
    """kMethod of each message, calls apart from notifications."""
    calls = set(re.findall(r'struct \w+Call \{\n\s+static constexpr std::string_view kMethod = "([^"]+)"', header))
    every = re.findall(r'kMethod = "([^"]+)"', header)
    return calls, {name for name in every if name not in calls} | {name for name in every if every.count(name) > 1}


def constants():
    """Whole numbers of protocol/limits.h by name."""
    found = {}
    for name, expression in re.findall(r"inline constexpr [\w:]+ (k\w+) = ([^;]+);", read("protocol", "limits.h")):
        plain = re.sub(r"[\w:]+\{(\d+)\}", r"\1", expression).replace("'", "")
        plain = re.sub(r"(?<=\d)U\b", "", plain)
        if re.fullmatch(r"[\d\s<*+e()]+|\w+( \* \w+)*", plain):
            try:
                found[name] = eval(plain, {"__builtins__": {}}, found)  # noqa: S307: our own header
            except NameError:
                continue
    return found


def written(number):
    return f"{number:,}"


class Specification(unittest.TestCase):
    def assertHas(self, text, wanted):
        """Without the text in the message, which would be all of it."""
        self.assertTrue(wanted in text, wanted)

    def assertExpected(self, wanted):
        """By a test, at least by its name."""
        self.assertTrue(re.search(rf"\b{wanted}\b", TESTS), f"no test mentions {wanted}")

    def test_methods_and_notifications_are_those_of_the_codec(self):
        calls, notes = structs_of(read("protocol", "messages.h"))
        headings = {name for line in re.findall(r"^### (.+)$", section("Methods"), re.MULTILINE) for name in line.split(", ")}
        self.assertEqual(headings, calls)
        self.assertEqual({name.strip("`") for name in first_cells("Notifications")}, notes)
        for name in calls | notes:
            kinds = {"call": calls, "reply": calls, "note": notes}
            for kind, members in kinds.items():
                if name in members:
                    self.assertTrue((ROOT / "protocol" / "examples" / f"{kind}-{name}.json").exists(), f"{kind}-{name}")

    def test_every_method_and_notification_is_in_a_test(self):
        for names, ending in zip(structs_of(read("protocol", "messages.h")), ("Call", None)):
            for name in names:
                found = f'"{name}"' in TESTS or f'"method":"{name}"' in TESTS or f"'{name}'" in TESTS
                typed = ending and "".join(part.capitalize() for part in name.split(".")) + ending
                self.assertTrue(found or (typed and typed in TESTS), name)

    def test_error_codes_are_those_of_the_codec_and_each_is_expected_by_a_test(self):
        codes = re.findall(r"k(\w+) = (-32\d+),", read("protocol", "json_rpc.h"))
        self.assertEqual(set(first_cells("Errors")), {code for _, code in codes})
        for name, code in codes:
            self.assertTrue(code in TESTS or f"RpcCode::k{name}" in TESTS, f"{code} {name}")

    def test_close_codes_are_those_of_the_server_and_each_is_expected_by_a_test(self):
        enumeration = re.search(r"enum class CloseCode.*?\};", read("protocol", "limits.h"), re.DOTALL).group(0)
        ours = set(re.findall(r"= (\d{4}),", enumeration)) - {"1000"}  # the client's own
        from_websocket = {"1002", "1007"}  # of RFC 6455, by Beast
        told = {code for cell in first_cells("Close codes") for code in cell.split(", ")}
        self.assertEqual(told, ours | from_websocket)
        for code in told - {"4408"}:
            self.assertExpected(code)
        self.assertExpected("too_slow")  # 4408 waits behind a write that hangs, so that tests see its counter

    def test_limits_are_those_of_the_header(self):
        of = constants()
        for what, limit in {
                "text message, either way": f"{of['kMaxMessageBytes'] // MIB} MiB",
                "JSON nesting": of["kMaxJsonDepth"],
                "calls in a batch": of["kMaxBatch"],
                "calls of a session waiting for their answer": of["kMaxCallsInFlight"],
                "`id`": f"{of['kMaxRequestIdBytes']} bytes of JSON text",
                "names, `client`, `camera`, `requestId`": f"{of['kMaxTextBytes']} bytes",
                "`token`, `url`, `path` of an operation": f"{written(of['kMaxTokenBytes'])} bytes",
                "operations of a patch": written(of["kMaxPatchOperations"]),
                "entries of a list": written(of["kMaxListEntries"]),
                "tile frame": f"{of['kTileHeaderBytes']} + {written(of['kTileSide'] ** 2 * of['kMaxPixelBytes'])} bytes",
                "credit": f"{of['kMaxCreditBytes'] // MIB} MiB",
                "`solve.wait` `timeoutMs`": f"{of['kMaxWaitMs'] // 3_600_000} h",
                "snapshot": f"{written(of['kMaxSnapshotSide'])} x {written(of['kMaxSnapshotSide'])} pixels",
                "connections": f"{of['kMaxClients']} (`--max-clients`), then 503",
                "shared cameras": f"{of['kMaxCameras']}, each told {of['kCameraCallsPerSecond']} times a second",
                "TLS handshake": f"within 10 s; {of['kMaxTlsHandshakes']} under way at a time"}.items():
            self.assertHas(section("Limits"), f"| {what} | {limit} |")
        patcher = "".join(read("server", "scene", "document", f"json_patch.{end}") for end in ("h", "cpp"))
        scene = dict(re.findall(r"(kMax\w+) = ([\d']+);", patcher))
        self.assertEqual(int(scene["kMaxPatchOperations"]), of["kMaxPatchOperations"])
        self.assertHas(section("Limits"), f"names in its pointers | {scene['kMaxRead'].replace(chr(39), ',')} |")
        self.assertHas(section("Limits"), f"| upload | {of['kMaxUploadBytes'] >> 30} GiB (`--max-upload`)")
        self.assertHas(section("Methods"), f"from 1\nto {written(of['kMaxTimeLimitMs'])}")
        self.assertHas(section("Methods"), f"the first {of['kMaxStatusWarnings']} warnings")
        self.assertHas(section("Methods"), f"longer than {of['kMaxInlineSceneBytes'] >> 10} KiB")
        self.assertHas(section("Methods"), f"creditBytes? = {of['kDefaultCreditBytes']}")
        self.assertHas(section("Methods"), f"limit? = {of['kMaxHistory']}")
        self.assertHas(section("Methods"), f"At most {of['kMaxErrorSamples']} samples")
        self.assertHas(section("Methods"), f"maxMip? = {of['kMaxMip']}")
        self.assertHas(section("Handshake"), f"Within {of['kHelloTimeoutMs'] // 1000} s")
        self.assertHas(section("Flow control"), f"within {of['kWriteDeadlineMs'] // 1000} s")
        self.assertHas(section("Flow control"), f"when {of['kControlLaneMessages']} of them or {of['kControlLaneBytes'] // MIB} MiB")

    def test_what_server_info_tells_is_listed(self):
        hub = read("server", "net", "hub.cpp")
        limits = re.search(r"info\.limits = \{(.*?)\};", hub, re.DOTALL).group(1)
        told = section("Limits").split("`serverInfo.limits`", 1)[1]
        self.assertEqual(set(re.findall(r'\{"(\w+)"', limits)), quoted(told))
        listed = quoted(section("Versions"))
        capabilities = re.search(r"info\.capabilities = .*?info\.limits", hub, re.DOTALL).group(0)
        for name in re.findall(r'"([\w.]+)"', capabilities):
            kind = name.split(".")[0] + ".<"
            self.assertTrue(name in listed or any(entry.startswith(kind) for entry in listed) or name == "quantity.", name)
        for name in listed - {"capabilities", "quantity.<name>", "codec.<name>", "tiles.<format>"}:
            self.assertIn(f'"{name}"', capabilities)

    def test_routes_are_those_of_the_server(self):
        routes = re.findall(r'Route\{"([^"]+)", "(GET|PUT)"', read("server", "net", "http_routes.cpp"))
        told = set()
        for cell in first_cells("HTTP"):
            method, target = cell.strip("`").split(" ")
            told.add((re.sub(r"<.*", "", target.split("?")[0]), method))
        told |= {(path.replace("...", ""), "GET") for path in ("/assets/...", "/favicon.svg") if f"`{path}`" in section("HTTP")}
        self.assertEqual(told, set(routes))

    def test_http_statuses_and_codes_are_those_of_the_server(self):
        net = "".join(read("server", "net", f"http_{part}.cpp") for part in ("message", "framing", "routes", "session"))
        answered = set(re.findall(r"return (\d{3});", net)) | set(re.findall(r"errorResponse\((\d{3}),", net))
        statuses = re.search(r"^Statuses: (.*?)Every error", section("HTTP"), re.MULTILINE | re.DOTALL).group(1)
        self.assertEqual(set(re.findall(r"\b([45]\d\d)\b", statuses)), answered)
        for status in answered - {"500"}:  # an engine that is at fault
            self.assertExpected(status)
        codes = set(re.findall(r'ErrorCode::k\w+, "(\w+)"', read("protocol", "http_bodies.cpp")))
        codes |= set(re.findall(r'errorResponse\(\d{3}, "(\w+)"', net))
        self.assertEqual(set(re.search(r"`code` one of\n`([^`]+)`", section("HTTP")).group(1).split()), codes)

    def test_headers_that_the_server_sets_or_reads_are_told(self):
        sources = "".join(read("server", "net", f"http_{part}.cpp") for part in ("message", "framing", "routes", "session"))
        named = set(re.findall(r'(?:emplace_back|message|m\.set)[(\[]"([A-Z][\w-]+)"', sources))
        named |= {"-".join(word.capitalize() for word in field.split("_")) for field in re.findall(r"http::field::(\w+)", sources)}
        usual = {"Content-Type", "Host", "Date", "Server", "Cache-Control", "Vary", "X-Content-Type-Options",
                 "Content-Security-Policy", "Sec-Websocket-Protocol", "Accept-Encoding", "If-None-Match", "Upgrade", "Access-Control-Allow-Methods",
                 "Access-Control-Allow-Headers", "Access-Control-Expose-Headers"}  # as HTTP has them
        for header in named - usual:
            self.assertTrue(f"`{header}" in SPECIFICATION, header)
            self.assertTrue(f'"{header}"' in TESTS or f"{header}: " in TESTS, f"no test mentions {header}")


if __name__ == "__main__":
    unittest.main()
