# results.py TESTS.xml: counts of a ctest run (`ctest --output-junit`), as "total failed skipped", on stdout; the last lines of what
# each failed test printed on stderr, since the end of a log is all that some see of it.
import sys
import xml.etree.ElementTree

suite = xml.etree.ElementTree.parse(sys.argv[1]).getroot()
for test in suite.iter("testcase"):
    if test.find("failure") is not None:
        print(f"== {test.get('name')} failed; the end of what it printed:", file=sys.stderr)
        lines = (test.findtext("system-out") or "").rstrip().splitlines()
        print("\n".join(line[:400] for line in lines[-30:]), file=sys.stderr)
count = {name: int(suite.get(name)) for name in ("tests", "failures", "disabled", "skipped")}
print(count["tests"], count["failures"], count["disabled"] + count["skipped"])
