"""Names of the elements of data sets with several columns."""

from collections.abc import Mapping, Sequence

from pdmp._labels import name_list

QUATERNION = ("qx", "qy", "qz", "qw")


def feature_list(features: str | Sequence[str]) -> list[str]:
    """Returns the names of one or several features."""
    return [features] if isinstance(features, str) else name_list("features", features)


def unique_names(own: Mapping[str, Sequence[str]]) -> list[str]:
    """Returns the names of the elements of features, with the feature's where two are equal."""
    names = [name for elements in own.values() for name in elements]
    if len(set(names)) == len(names):
        return names
    return [f"{feature}.{name}" for feature, elements in own.items() for name in elements]


def numbered(feature: str, n_elements: int) -> list[str]:
    """Returns names of the elements of a feature without names."""
    return [feature] if n_elements == 1 else [f"{feature}.{k}" for k in range(n_elements)]
