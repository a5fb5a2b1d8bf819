"""Recordings of people and robots, and a registry of their sources.

`handwriting` reads human handwriting from an installed package. The licences of
the other sets do not allow a copy in this package: `REGISTRY` gives source, licence and contents of
each, and `folder` its path below the folder in the environment variable `PDMP_DATA`::

    demos = pdmp.io.read_folder(
        pdmp.datasets.folder("raise_hand_bandai"), context=["hold_height_m"]
    )
"""

from pdmp.datasets._dataset import Dataset
from pdmp.datasets._folder import folder
from pdmp.datasets._lasa import handwriting
from pdmp.datasets._registry import REGISTRY

__all__ = ["REGISTRY", "Dataset", "folder", "handwriting"]
