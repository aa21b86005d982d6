"""From the network's maps to things, as the mapper does it (mapper/segment/network_maps.cc), and how good they are."""
import cv2
import numpy as np

LEAST_CENTRE = 0.3     # of a centre's map, after its logit became a share
CENTRE_REACH_PX = 4    # the greatest within so many pixels to each side is one
LEAST_PIXELS = 20


def of_maps(maps):
    """Ids (0: no thing; 1 and up, by rows of their centres) of maps (4 x height x width, network.py)."""
    thing = maps[0] > 0
    centre = 1 / (1 + np.exp(-maps[1]))
    most = cv2.dilate(centre, np.ones((2 * CENTRE_REACH_PX + 1,) * 2, np.uint8))
    v, u = np.nonzero((centre == most) & (centre > LEAST_CENTRE) & thing)
    ids = np.zeros(thing.shape, np.int32)
    if len(v) == 0:
        return ids
    rows, columns = np.nonzero(thing)
    to_v = rows + maps[3][thing]
    to_u = columns + maps[2][thing]
    distance = (to_v[:, None] - v) ** 2 + (to_u[:, None] - u) ** 2
    ids[thing] = 1 + distance.argmin(axis=1)
    for number in range(1, len(v) + 1):
        if (ids == number).sum() < LEAST_PIXELS:
            ids[ids == number] = 0
    return ids


class Quality:
    """Panoptic quality of things over frames."""

    def __init__(self):
        self.overlap, self.matched, self.missed, self.invented = 0.0, 0, 0, 0

    def add(self, true, found):
        numbers, found_numbers = set(np.unique(true)) - {0}, set(np.unique(found)) - {0}
        left = set(found_numbers)
        for number in numbers:
            there = true == number
            for other in np.unique(found[there]):
                if other == 0:
                    continue
                both = (there & (found == other)).sum()
                share = both / (there | (found == other)).sum()
                if share > 0.5:
                    self.overlap += share
                    self.matched += 1
                    left.discard(other)
                    break
            else:
                self.missed += 1
        self.invented += len(left)

    def pq(self):
        total = self.matched + 0.5 * (self.missed + self.invented)
        return self.overlap / total if total else 0.0
