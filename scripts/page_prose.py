"""The prose of a Markdown page: what is no table, heading, comment, picture or code. It is at most WIDTH characters wide."""
import re

WIDTH = 120
ITEM = re.compile(r" *([-*+>]|\d+[.)]) +")
OTHER = re.compile(r" *(\||#|<!--|!\[[^]]*\]\([^)]*\)$)")
# A word that at a line's beginning would be the mark of an item or of a heading.
MARK = re.compile(r"([-*+>]|#+|\d+[.)])$")


def paragraphs_of(lines):
    """Ranges of lines, one a paragraph; an item of a list is one."""
    found, fenced, is_open = [], False, False
    for i, line in enumerate(lines):
        if line.lstrip().startswith("```"):
            fenced, is_open = not fenced, False
        elif fenced or not line.strip() or OTHER.match(line):
            is_open = False
        elif is_open and not ITEM.match(line):
            found[-1] = range(found[-1].start, i + 1)
        elif not line.startswith("    ") or ITEM.match(line):  # else it is code
            found.append(range(i, i + 1))
            is_open = True
    return found


def is_wide(line):
    """Whether it is too wide, and could be broken."""
    return len(line) > WIDTH and " " in line.strip()


def filled(lines):
    """The paragraph in lines of that width, where its words allow it."""
    item = ITEM.match(lines[0])
    begin = item.group() if item else lines[0][:len(lines[0]) - len(lines[0].lstrip())]
    words = " ".join([lines[0][len(begin):], *lines[1:]]).split()
    out = [begin + words[0]]
    for i, word in enumerate(words[1:], 1):
        # A mark stays with the word before it.
        needed = word if i + 1 == len(words) or not MARK.match(words[i + 1]) else f"{word} {words[i + 1]}"
        if len(out[-1]) + 1 + len(needed) <= WIDTH or MARK.match(word):
            out[-1] += " " + word
        else:
            out.append(" " * len(begin) + word)
    return out


def wrapped(text):
    """The text, with paragraphs that are too wide filled anew."""
    lines = text.split("\n")
    for paragraph in reversed(paragraphs_of(lines)):
        part = lines[paragraph.start:paragraph.stop]
        if any(map(is_wide, part)):
            lines[paragraph.start:paragraph.stop] = filled(part)
    return "\n".join(lines)


def too_wide(text):
    """The numbers of the lines of prose that are too wide, from 1."""
    lines = text.split("\n")
    return [i + 1 for paragraph in paragraphs_of(lines) for i in paragraph if is_wide(lines[i])]
