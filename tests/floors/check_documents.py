#!/usr/bin/env python3
"""Fails where a document's link leads nowhere, or where a program's message names a document that is not installed.

  check_documents.py ROOT INSTALLED   INSTALLED: the installed documents, relative to ROOT, with commas between them
  check_documents.py --links FOLDER   only the links, of the documents as they are installed
  check_documents.py --self-test      a tree with planted faults
"""
import pathlib
import re
import sys
import tempfile

FOLDERS = ("calib", "service", "clients", "idl", "configs", "tests", ".github")
SOURCES = {".cpp", ".h", ".ts", ".html", ".py", ".service", ".1", ".8"}
NAMED = re.compile(r"\b((?:calib|service|clients|idl|configs)/[\w./-]*\.(?:md|yaml))(#[\w-]+)?")


def files(root, suffixes):
    tops = [root / "README.md", *(path for folder in FOLDERS for path in sorted((root / folder).rglob("*")))]
    return [path for path in tops if path.suffix in suffixes and path.is_file() and "node_modules" not in path.parts]


def without_code(text):
    return re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)


def anchors(path):
    """As GitHub makes them."""
    out = set()
    for heading in re.findall(r"^#+ (.*)$", without_code(path.read_text()), flags=re.M):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").replace("*", "").strip().lower()
        out.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return out


def broken_links(root):
    for path in files(root, {".md"}):
        for link in re.findall(r"\]\(([^)\s]+)\)", without_code(path.read_text())):
            if re.match(r"https?:|mailto:", link):
                continue
            name, _, anchor = link.partition("#")
            to = path.parent / name if name else path
            where = f"{path.relative_to(root)}: the link {link}"
            if not to.exists():
                yield f"{where} leads to no file"
            elif anchor and to.suffix == ".md" and anchor not in anchors(to):
                yield f"{where} leads to no heading"


def messages(path):
    """What the file may print: string literals, those of adjacent lines as one; a page or a man page as a whole."""
    text = path.read_text()
    if path.suffix not in {".cpp", ".h", ".ts"}:
        return text
    lines = [line for line in text.splitlines() if not re.match(r"\s*(//|#include|import )", line)]
    joined = re.sub(r'"\s*\n\s*"', "", "\n".join(lines))
    return "\n".join(re.findall(r'"(?:[^"\\\n]|\\.)*"|`[^`]*`', joined))


def wrong_names(root, installed):
    for path in files(root, SOURCES):
        if path.is_relative_to(root / "tests"):
            continue
        for name, anchor in NAMED.findall(messages(path)):
            where = f"{path.relative_to(root)}: a message names {name}{anchor}"
            if not (root / name).exists():
                yield f"{where}, which does not exist"
            elif name not in installed:
                yield f"{where}, which is not installed"
            elif anchor and anchor[1:] not in anchors(root / name):
                yield f"{where}, which has no such heading"


def self_test():
    with tempfile.TemporaryDirectory() as scratch:
        root = pathlib.Path(scratch)
        (root / "calib").mkdir()
        (root / "README.md").write_text("[a](calib/a.md#a-b) [b](calib/none.md) [c](calib/a.md#none)\n```\n[d](none)\n```\n")
        (root / "calib/a.md").write_text("# A, `b`\n")
        (root / "calib/b.md").write_text("# B\n")
        (root / "calib/x.cpp").write_text(
            '// calib/comment.md\nf("see calib/"\n  "a.md", "calib/a.md#a-b");\nf("calib/b.md, calib/none.md, calib/a.md#none");\n')
        found = [*broken_links(root), *wrong_names(root, {"calib/a.md"})]
        expected = [
            "README.md: the link calib/none.md leads to no file", "README.md: the link calib/a.md#none leads to no heading",
            "calib/x.cpp: a message names calib/b.md, which is not installed",
            "calib/x.cpp: a message names calib/none.md, which does not exist",
            "calib/x.cpp: a message names calib/a.md#none, which has no such heading"]
        if found != expected:
            sys.exit("found:\n  " + "\n  ".join(found))


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if sys.argv[1] == "--links":
        folder = pathlib.Path(sys.argv[2])
        if not files(folder, {".md"}):
            sys.exit(f"no document is in {folder}")
        if faults := list(broken_links(folder)):
            sys.exit("\n".join(faults))
        return
    root, installed = pathlib.Path(sys.argv[1]), set(sys.argv[2].split(","))
    if not any(NAMED.search(messages(path)) for path in files(root, {".cpp"})):
        sys.exit("no message names a document: this test looks in the wrong place")
    if faults := [*broken_links(root), *wrong_names(root, installed)]:
        sys.exit("\n".join(faults))


main()
