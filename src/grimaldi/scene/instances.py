"""Instances written out: Mitsuba tells nothing of what is inside one."""

from __future__ import annotations

from typing import Any

from grimaldi.errors import InputError
from grimaldi.scene.messages import where


def write_out(state: Any) -> None:
    """Replaces each `instance` of a parsed scene by copies of its group's shapes, named "instance.shape".

    Raises InputError for an instance that names no `shapegroup`.
    """
    import mitsuba as mi

    root = state.root.props
    copies = {}
    for name in list(root):
        index = _reference(root, name)
        if index is not None and state.nodes[index].props.plugin_name() == "instance":
            copies[name] = _copies(state, state.nodes[index], name)
    # as the nodes become more they move: what was read of them is gone then
    for name, shapes in copies.items():
        for child, shape in shapes:
            state.nodes.append(shape)
            state.root.props[f"{name}.{child}"] = mi.Properties.ResolvedReference(len(state.nodes) - 1)
        del state.root.props[name]


def _copies(state: Any, instance: Any, name: str) -> list[tuple[str, Any]]:
    """The shapes of an instance's group in its place, and what the group calls them."""
    import mitsuba as mi

    group, found = _group(state, instance), []
    for child in list(group):
        shape = _reference(group, child)
        if shape is None:
            continue
        copy, original = mi.parser.SceneNode(), state.nodes[shape]
        copy.type, copy.file_index, copy.offset = original.type, original.file_index, original.offset
        copy.props = mi.Properties(original.props)
        copy.props.set_id(f"{instance.props.id() or name}.{original.props.id() or child}")
        transforms: list[Any] = [p["to_world"] for p in (instance.props, original.props) if "to_world" in p]
        if transforms:
            copy.props["to_world"] = transforms[0] @ transforms[1] if len(transforms) > 1 else transforms[0]
        found.append((child, copy))
    return found


def _group(state: Any, instance: Any) -> Any:
    """The properties of the group that an instance repeats."""
    import mitsuba as mi

    for name in instance.props:
        index = _reference(instance.props, name)
        if index is not None and state.nodes[index].props.plugin_name() == "shapegroup":
            return state.nodes[index].props
    place = where(mi.parser.file_location(state, instance))
    raise InputError(f"{place}: an instance without a shapegroup; refer to one by its id")


def _reference(props: Any, name: str) -> int | None:
    """The node that a property refers to; None where it is a plain value. Reading that would count as its use."""
    import mitsuba as mi

    return props[name].index() if props.type(name) == mi.Properties.Type.ResolvedReference else None
