"""The access list: a vehicle publishes its own keys and nothing else, a viewer reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from service.publisher import keys

_EVERYTHING = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)
_READING = ("declare_subscriber", "declare_liveliness_subscriber", "liveliness_query")


@dataclass(frozen=True)
class Access:
    """Who is who. Whoever is not named may do nothing.

    Args:
        vehicles: may publish on `uavdepth/<name>/...` and hear what the ground says about that.
        viewers: may read everything, and report what they have received (`uavdepth/*/received`).
        routers: hand on what they have checked themselves: may do everything below `uavdepth/`.
    """

    vehicles: tuple[str, ...] = ()
    viewers: tuple[str, ...] = ()
    routers: tuple[str, ...] = ()

    def as_zenoh(self, *, by_certificate: bool, by_user: bool) -> dict[str, Any]:
        """Zenoh's `access_control`, everything else denied.

        Args:
            by_certificate: the names are common names of certificates.
            by_user: the names are users. With both a connection must show both.
        """
        received = keys.key("*", keys.RECEIVED)
        rules = [
            _rule("out", _EVERYTHING, ["**"], "egress"),
            _rule("read", _READING, [f"{keys.ROOT}/**"]),
            _rule("report", ("put",), [received]),
            _rule("hand-on", _EVERYTHING, [f"{keys.ROOT}/**"]),
        ]
        members = [
            *((name, ["out", "read", "report"]) for name in self.viewers),
            *((name, ["out", "hand-on"]) for name in self.routers),
        ]
        for name in self.vehicles:
            publish, hear = f"publish-{name}", f"hear-{name}"
            own = keys.key(name, "*")
            rules.append(_rule(publish, ("put", "delete", "liveliness_token"), [own]))
            rules.append(_rule(hear, ("declare_subscriber",), [keys.key(name, keys.RECEIVED)]))
            members.append((name, ["out", publish, hear]))
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": rules,
            "subjects": [
                {
                    "id": name,
                    **({"cert_common_names": [name]} if by_certificate else {}),
                    **({"usernames": [name]} if by_user else {}),
                }
                for name, _ in members
            ],
            "policies": [{"subjects": [name], "rules": allowed} for name, allowed in members],
        }


def _rule(name: str, messages: Sequence[str], key_exprs: list[str], flow: str = "ingress") -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "messages": list(messages),
        "flows": [flow],
        "key_exprs": key_exprs,
    }
