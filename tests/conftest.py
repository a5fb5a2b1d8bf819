"""Models shared by several test modules, and the policy of random tests.

Tests of random values, by hypothesis here and by proptest in Rust, draw the same values in every
run: a failure then comes from the change that is tested, on every machine, and the search for new
cases is left to `make fuzz`. Others are drawn, for a longer search, by

    pytest --hypothesis-profile=random            (with --hypothesis-seed=N for the same again)
    PROPTEST_RNG_SEED=N cargo test --release      (0 by default, in .cargo/config.toml)
"""

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

import pdmp
from synthetic import loops, reaches

settings.register_profile("fixed", derandomize=True, deadline=None, database=None)
settings.register_profile("random", deadline=None, database=None, print_blob=True)
settings.load_profile("fixed")


@pytest.fixture(scope="session")
def reach() -> pdmp.Model:
    """Returns a discrete model with two styles and two degrees of freedom."""
    return pdmp.fit(reaches(), n_styles=2, basis="ngnet")


@pytest.fixture(scope="session")
def cycle() -> pdmp.Model:
    """Returns a rhythmic model with two styles and two degrees of freedom."""
    return pdmp.fit(loops(), kind="rhythmic", n_styles=2, basis="ngnet")


@pytest.fixture(params=["discrete", "rhythmic"])
def model(request: pytest.FixtureRequest) -> pdmp.Model:
    """Returns the model of either kind."""
    fixture = {"discrete": "reach", "rhythmic": "cycle"}[request.param]
    fitted: pdmp.Model = request.getfixturevalue(fixture)
    return fitted


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Yields the client of a cluster of two processes."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as connected,
    ):
        yield connected
