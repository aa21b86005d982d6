"""The disk that scripts/faults.py gives a command: what a folder takes of one, and one that is small or may not be written."""
import os
import subprocess
import sys

PAGE = 4096


def bytes_on_disk(folder):
    total = 0
    for base, folders, files in os.walk(folder):
        for name in files:
            total += -(-os.lstat(os.path.join(base, name)).st_size // PAGE) * PAGE
    return total


def count_on_disk(folder):
    return sum(len(folders) + len(files) for _, folders, files in os.walk(folder))


class OnADisk:
    """A small disk of memory with the command's folder on it; needs root and a mount namespace of our own."""

    def __init__(self, lab, command, free_share=None, files_share=None, read_only=False):
        self.lab, self.command = lab, command
        self.free_share, self.files_share, self.read_only = free_share, files_share, read_only
        self.place = lab.at("disk")

    def mount(self, *options):
        subprocess.run(["mount", *options, self.place], check=True, stdout=subprocess.DEVNULL)

    def __enter__(self):
        os.makedirs(self.place, exist_ok=True)
        self.mount("-t", "tmpfs", "-o", "size=1g", "none")
        self.lab.restore(self.command, self.place)
        learned = self.lab.learned[self.command.name]
        if self.free_share is not None:
            # An empty file system of size 0 would have no limit.
            size = max(PAGE, learned.before_bytes + int(self.free_share * learned.whole_bytes) // PAGE * PAGE)
            size = max(size, self.used())
            self.mount("-o", f"remount,size={size}")
        if self.files_share is not None:
            # The root itself counts.
            files = 1 + count_on_disk(self.place) + int(self.files_share * len(learned.whole))
            self.mount("-o", f"remount,nr_inodes={files}")
        if self.read_only:
            self.mount("-o", "remount,ro")
        return self

    def used(self):
        status = os.statvfs(self.place)
        return (status.f_blocks - status.f_bfree) * status.f_frsize

    def repair(self):
        self.mount("-o", "remount,rw,size=1g,nr_inodes=100000")

    def __exit__(self, *_):
        subprocess.run(["umount", self.place], check=True)


if __name__ == "__main__":
    sys.exit("run scripts/faults.py")
