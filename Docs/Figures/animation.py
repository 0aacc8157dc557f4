"""animation.py FOLDER OUT: joins the pictures of a folder into an animated WebP, a loop of 4 s."""

import pathlib
import sys

from PIL import Image

SECONDS = 4

folder, out = map(pathlib.Path, sys.argv[1:])
files = sorted(folder.glob("*.png"))
frames = [Image.open(file).convert("RGB") for file in files]
frames[0].save(out, save_all=True, append_images=frames[1:], duration=round(1000 * SECONDS / len(frames)),
               loop=0, quality=75, method=4)
print(f"{out}: {len(frames)} pictures, {out.stat().st_size / 1e6:.2f} MB")
