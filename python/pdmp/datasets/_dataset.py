"""Descriptions of sets of recordings."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Dataset:
    """Description of a set of recordings.

    Attributes
    ----------
    name : str
        Name of the set, and of its folder below the one that `PDMP_DATA` names.
    contents : str
        Movement, origin and degrees of freedom.
    kind : {"discrete", "rhythmic"}
        Kind of the movement.
    n_recordings : int
        Number of recordings.
    varies : str
        Differences between the recordings: context, or names of repetitions.
    units : str
        Units of the degrees of freedom and of time.
    source : str
        Name of the publisher's repository or package, with its version or commit.
    url : str
        Address of the recordings.
    licence : str
        Licence under which they are published.
    credit : str
        Reference to cite, or acknowledgement that the licence requires; "" if there is none.
    """

    name: str
    contents: str
    kind: Literal["discrete", "rhythmic"]
    n_recordings: int
    varies: str
    units: str
    source: str
    url: str
    licence: str
    credit: str = ""
