"""Fits one primitive to human handwriting, blends two letters, and recognises a new recording.

The recordings come with the extra `datasets`.
"""

import matplotlib.pyplot as plt
import numpy as np

import pdmp

SHAPES = ["CShape", "GShape", "Sshape"]
recordings = pdmp.datasets.handwriting(SHAPES)
# The last recording of each shape is left out.
demos = [demo for shape in SHAPES for demo in recordings[shape][:-1]]
labels = [shape for shape in SHAPES for _ in recordings[shape][:-1]]
model = pdmp.fit(demos)
print(f"{model.n_demos} recordings, J = {model.n_styles}, noise {model.noise.round(3)} mm")

members = {shape: [m for m, label in enumerate(labels) if label == shape] for shape in SHAPES}
means = {shape: model.conditions(members[shape]) for shape in SHAPES}

for shape in SHAPES:
    style = model.style_of(recordings[shape][-1])
    distances = {name: np.linalg.norm(style - mean.style) for name, mean in means.items()}
    print(f"a new {shape} has the style of {min(distances, key=distances.get)}")

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
for color, shape in enumerate(SHAPES):
    for m in members[shape]:
        left.plot(*demos[m].position.T, color="0.8", linewidth=2)
    left.plot(*model.rollout(means[shape]).position.T, color=f"C{color}", label=shape)
for share in np.linspace(0, 1, 9):
    blended = model.rollout(pdmp.blend(means["CShape"], means["Sshape"], share))
    right.plot(*blended.position.T, color=plt.colormaps["viridis"](0.9 * share))
left.set(xlabel="x [mm]", ylabel="y [mm]", title="Recordings (grey) and mean conditions")
left.legend()
right.set(xlabel="x [mm]", title="From the C to the S")
figure.savefig("00_handwriting.png", dpi=150)
