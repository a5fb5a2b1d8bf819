"""Models that several modules of tests move, each fitted once, when a test first asks for it."""

import pytest

import pdmp
from synthetic import loops, reaches


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
    fitted: pdmp.Model = request.getfixturevalue(
        {"discrete": "reach", "rhythmic": "cycle"}[request.param]
    )
    return fitted
