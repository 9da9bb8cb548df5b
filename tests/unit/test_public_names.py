"""Public names stay what they are, whatever else of the package is imported."""

import importlib
import pkgutil

import rigidimpulse as ri


def test_no_module_hides_a_public_name() -> None:
    modules = {module.name for module in pkgutil.iter_modules(ri.__path__)}
    assert not modules & set(ri.__all__)


def test_every_public_name_is_there() -> None:
    importlib.import_module("rigidimpulse.engine.simulate")
    for name in ri.__all__:
        assert callable(getattr(ri, name)), name
