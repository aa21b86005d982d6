#!/usr/bin/python3
"""Puts files into a page: what stands between `<!-- file: NAME -->` and the next `<!-- end -->` becomes FOLDER/NAME.md.

Usage: fill_page.py FOLDER PAGE ...
"""
import os
import re
import sys


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    folder = sys.argv[1]

    def text_of(name):
        with open(os.path.join(folder, name + ".md")) as file:
            return file.read()

    filled = {}
    for page in sys.argv[2:]:
        with open(page) as file:
            filled[page], count = re.subn(r"(<!-- file: (\S+) -->\n).*?(<!-- end -->)",
                                          lambda match: match[1] + text_of(match[2]) + match[3], file.read(), flags=re.S)
        if count == 0:
            sys.exit(f"{page} has no place for a file, expected <!-- file: NAME --> and <!-- end -->")
    for page, text in filled.items():
        with open(page, "w") as file:
            file.write(text)


if __name__ == "__main__":
    main()
