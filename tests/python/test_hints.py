"""What an editor and a type checker see of the package: each function has its types and its sentence."""

import importlib
import inspect
import pkgutil
import typing
import unittest
from pathlib import Path

import rtbus


def functions():
    """(name, function) of all modules, the methods and properties of their classes included."""
    for found in pkgutil.iter_modules(rtbus.__path__):
        module = importlib.import_module(f"rtbus.{found.name}")
        for name, value in vars(module).items():
            if getattr(value, "__module__", None) != module.__name__:
                continue
            if inspect.isfunction(value):
                yield f"{module.__name__}.{name}", value
            for member_name, member in vars(value).items() if inspect.isclass(value) else ():
                member = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                if inspect.isfunction(member) and Path(member.__code__.co_filename).name == f"{found.name}.py":
                    yield f"{module.__name__}.{name}.{member_name}", member


class Hints(unittest.TestCase):
    def test_each_parameter_and_each_result_has_its_type(self):
        names = []
        for name, function in functions():
            names.append(name)
            with self.subTest(function=name):
                said = inspect.signature(function)
                bare = [each.name for each in said.parameters.values()
                        if each.annotation is each.empty and each.name not in ("self", "_")]
                self.assertEqual(bare, [])
                self.assertIsNot(said.return_annotation, said.empty)
        for known in ("rtbus.engine.Hand.mass", "rtbus.topics.Topic.dtype", "rtbus.session.run", "rtbus.writer.publisher"):
            self.assertIn(known, names)

    def test_each_public_function_and_class_says_what_it_does(self):
        for name, function in functions():
            if not any(part.startswith("_") for part in name.split(".")):
                with self.subTest(function=name):
                    self.assertTrue(inspect.getdoc(function))
        for name in rtbus.__all__:
            with self.subTest(name=name):
                self.assertTrue(inspect.getdoc(getattr(rtbus, name)))

    def test_the_types_are_names_that_exist(self):
        for name in rtbus.__all__:
            value = getattr(rtbus, name)
            members = [value] if inspect.isfunction(value) else [each for each in vars(value).values() if inspect.isfunction(each)]
            for each in members:
                if inspect.isfunction(each) and each.__module__.startswith("rtbus."):
                    with self.subTest(function=each.__qualname__):
                        typing.get_type_hints(each)

    def test_the_package_says_that_it_has_types(self):
        self.assertTrue((Path(rtbus.__file__).parent / "py.typed").exists())


if __name__ == "__main__":
    unittest.main()
