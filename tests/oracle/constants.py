#!/usr/bin/python3
"""Counts the decision constants on the object path, and holds the count to constants.txt: it may only fall.

    constants.py [--list] [--root DIR] [--lower]

A decision constant is a hand-set number that changes a result:
  - a field of a `struct ...Tuning`;
  - a `constexpr` number outside of one, unless its comment, behind it or above it, begins with capacity:, layout:, unit: or
    maths:, or its value follows from other constants (names, and numbers that are harmless, such as 2);
  - a literal with a decimal point or an exponent in an expression, but for 0.5, powers of ten that change a unit and numbers below 1e-9 that keep a division finite. Whole
    numbers in expressions are mostly sizes and indices; they do not count.
Options that users set (structs ...Options, service/config) are no decision constants. --lower writes the count to constants.txt.
"""
import argparse
import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
OBJECT_PATH = ("service/object_tracking", "service/outline", "service/room_watch", "service/view_watch", "service/pipeline")
NUMBER = r"(?:0x[0-9a-fA-F]+|(?:\d[\d']*\.?[\d']*|\.\d+)(?:[eE][-+]?\d+)?)[fFuUlL]*"
HARMLESS = {0, 1, 2, 0.5, 1e3, 1e-3, 1e6, 1e-6, 1e9, 1e-9, 180, 360}
NOT_A_DECISION = re.compile(r"//\s*(capacity|layout|unit|maths)(:|\s*$)", re.M)
TUNING = re.compile(r"struct (\w*Tuning)\s*\{(.*?)\n\s*\};", re.S)
FIELD = re.compile(r"^\s*(?:double|float|int|bool|unsigned|std::\w+|Eigen::Index)\s+(\w+)\s*=\s*([^;]+);\s*(//.*)?$", re.M)
CONSTEXPR = re.compile(r"\bconstexpr\s+(?!\w*Tuning\b)(?:const\s+)?([\w:<>]+(?:\s*<[^;=]*?>)?)\s+([^;()]*?[={][^;]*);([^\n]*)", re.S)


def without_comments_and_strings(text):
    text = re.sub(r'"(?:\\.|[^"\\\n])*"', '""', text)
    text = re.sub(r"(?<![0-9a-fA-F])'(?:\\.|[^'\\\n])'", "' '", text)
    return re.sub(r"/\*.*?\*/", "", re.sub(r"//[^\n]*", "", text), flags=re.S)


def is_harmless(literal):
    plain = re.sub(r"[fFuUlL']", "", literal) if not literal.startswith("0x") else literal
    return not re.search(r"[.eE]", plain) or plain.startswith("0x") or float(plain) in HARMLESS or 0 < float(plain) < 1e-9


def numbers_in(code):
    """Literals of an expression that decide: without indices, template arguments, sizes of vectors and shifts."""
    code = re.sub(r"<[\w\s:,*&]*\d[\w\s:,*&]*>", "", code)          # template arguments
    code = re.sub(r"\[[^\[\]]*\]", "", code)                        # indices
    code = re.sub(r"(<<|>>)\s*\d+", "", code)
    return [n for n in re.findall(r"(?<![\w.])" + NUMBER + r"(?![\w.])", code) if not is_harmless(n)]


def constants_of(text):
    """[(name or place, what)] of one file."""
    found = []
    for tuning in TUNING.finditer(text):
        found += [(f"{tuning[1]}.{field[1]}", field[2].strip()) for field in FIELD.finditer(tuning[2])]
    text = TUNING.sub("", text)
    text = re.sub(r"struct \w*Options\s*\{.*?\n\};", "", text, flags=re.S)

    def take(match):
        above = re.search(r"((?:^[ ]*//[^\n]*\n|^[ ]*(?:static |inline )*constexpr (?!\w*Tuning)[^\n]*\n)*)[^\n]*\Z", text[:match.start()], re.M)[1]
        if NOT_A_DECISION.search(match[3]) or NOT_A_DECISION.search(match[0]) or NOT_A_DECISION.search(above):
            return ""
        code = without_comments_and_strings(match[2])
        for declared in re.split(r",(?![^(){}]*[)}])", code):
            name = re.match(r"\s*(\w+)", declared)
            value = declared.split("=", 1)[-1] if "=" in declared else declared
            numbers = re.findall(r"(?<![\w.])" + NUMBER + r"(?![\w.])", value)
            is_derived = re.search(r"[A-Za-z_]\w*\.?\w*", re.sub(NUMBER, "", value)) and all(is_harmless(n) and float(re.sub("[fFuUlL']", "", n)) in HARMLESS for n in numbers if not n.startswith("0x"))
            if name and numbers and not is_derived:
                found.append((name[1], value.strip()[:40]))
        return ""

    text = CONSTEXPR.sub(take, text)
    lines = without_comments_and_strings(text).split("\n")
    for line in lines:
        if not line.lstrip().startswith("#"):
            found += [("literal", n + " in " + line.strip()[:70]) for n in numbers_in(line)]
    return found


def count(root):
    out = {}
    for folder in OBJECT_PATH:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix in (".h", ".cpp"):
                out[str(file.relative_to(root))] = constants_of(file.read_text())
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--root", type=pathlib.Path, default=ROOT)
    parser.add_argument("--lower", action="store_true")
    options = parser.parse_args()
    found = count(options.root)
    if options.list:
        for file, constants in found.items():
            for name, what in constants:
                print(f"{file}: {name} = {what}")
    for folder in OBJECT_PATH:
        print(f"{folder:28}{sum(len(c) for f, c in found.items() if f.startswith(folder + '/')):5}")
    total = sum(map(len, found.values()))
    limit_file = HERE / "constants.txt"
    if options.lower:
        limit_file.write_text(f"{total}\n")
    limit = int(limit_file.read_text())
    print(f"{'all':28}{total:5}   (at most {limit}: tests/oracle/constants.txt)")
    if total < limit:
        print("fewer than before: write it down with tests/oracle/constants.sh --lower")
    return 1 if total > limit else 0


if __name__ == "__main__":
    sys.exit(main())
