"""A vocabulary of binary words for ORB-SLAM3 from pictures: python vocabulary.py PICTURES.npz VOCABULARY.txt.

A tree of 10 branches and 5 levels by k-majority on bits (Galvez-Lopez and Tardos, TRO 2012), in DBoW2's text form: the
first line `branches levels scoring weighting`, then a node a line, parents first: parent, whether it is a leaf, the 32
bytes of its word, its weight.
"""

import sys

import cv2
import numpy as np

BRANCHES = 10
LEVELS = 5
ROUNDS = 6
FEWEST = 12


def descriptors(pictures: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """ORB words (N, 256) as bits, and the picture (N,) of each."""
    orb = cv2.ORB_create(2000)
    found = []
    owner = []
    for nth, picture in enumerate(pictures):
        for scale in (0.35, 0.7):
            small = cv2.resize(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), None, fx=scale, fy=scale)
            _, words = orb.detectAndCompute(small, None)
            if words is not None:
                found.append(np.unpackbits(words, axis=1))
                owner.append(np.full(len(words), nth))
    return np.concatenate(found), np.concatenate(owner)


def clustered(bits: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Centres (K, 256) of bits (N, 256), and the nearest of each (N,)."""
    centres = bits[rng.choice(len(bits), BRANCHES, replace=False)]
    for _ in range(ROUNDS):
        signed = 2.0 * centres - 1
        nearest = np.argmax((2.0 * bits - 1) @ signed.T, axis=1)
        centres = np.array(
            [bits[nearest == k].mean(0) >= 0.5 if (nearest == k).any() else centres[k] for k in range(BRANCHES)]
        )
    return centres.astype(np.uint8), nearest


def main() -> None:
    """Grow the tree level by level and write it."""
    stored = np.load(sys.argv[1])
    pictures = [stored[name] for name in stored.files]
    bits, owner = descriptors(pictures)
    rng = np.random.default_rng(0)
    lines = []
    branches = [(0, np.arange(len(bits)))]
    for level in range(1, LEVELS + 1):
        grown = []
        for parent, own in branches:
            centres, nearest = clustered(bits[own], rng)
            for k in np.unique(nearest):
                part = own[nearest == k]
                node = len(lines) + 1
                is_leaf = level == LEVELS or len(part) < FEWEST
                weight = np.log(len(pictures) / len(np.unique(owner[part]))) if is_leaf else 0.0
                word = " ".join(str(byte) for byte in np.packbits(centres[k]))
                lines.append(f"{parent} {int(is_leaf)} {word} {weight:.6f}")
                grown += [] if is_leaf else [(node, part)]
        branches = grown
    with open(sys.argv[2], "w", encoding="ascii") as file:
        file.write("\n".join([f"{BRANCHES} {LEVELS} 0 0", *lines]) + "\n")
    print(f"{len(bits)} words of {len(pictures)} images, {len(lines)} nodes")


if __name__ == "__main__":
    main()
