"""Topics over Cyclone DDS, with ROS 2's names, types and bytes.

Subscriptions take what is best effort or reliable, and keep the newest message only; publications are
reliable, as ROS 2's subscriptions want them by default. Without ``network`` everything stays on this
machine's loopback.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mckibben.errors import DataError
from mckibben.ros.kinds import Kind, topic_named
from mckibben.ros.messages import CLASSES

MOST_DOMAIN = 232
"""Highest domain whose ports exist."""

LOOPBACK = """<CycloneDDS><Domain>
<General>
<Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast>
</General>
<Discovery>
<ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers>
</Discovery>
</Domain></CycloneDDS>"""

_KEPT: dict[int, Any] = {}
"""Domains that are set up to stay on the loopback; a process has each once."""


@dataclass
class Subscription:
    """The newest message of a topic."""

    reader: Any

    def newest(self) -> Any | None:
        """Return the newest message since the last call, or None."""
        from cyclonedds.internal import InvalidSample

        found = [each for each in self.reader.take(64) if not isinstance(each, InvalidSample)]
        return found[-1] if found else None


@dataclass
class Publication:
    """What sends messages to a topic."""

    writer: Any

    def send(self, message: Any) -> None:
        """Send a message to whoever listens."""
        self.writer.write(message)


class Topics:
    """Topics of a domain.

    Parameters
    ----------
    domain : int
        ROS 2's domain, ``ROS_DOMAIN_ID``.
    network : bool
        Whether others on the network are heard and told, or this machine alone.

    Raises
    ------
    DataError
        If DDS cannot start.
    """

    def __init__(self, domain: int = 0, *, network: bool = False) -> None:
        from cyclonedds.core import DDSException
        from cyclonedds.domain import Domain, DomainParticipant

        if not 0 <= domain <= MOST_DOMAIN:
            raise DataError(f"domain {domain}", remedy=f"give 0 to {MOST_DOMAIN}")
        if network and domain in _KEPT:
            raise DataError(
                f"domain {domain} is on this machine alone already", remedy="use another process"
            )
        try:
            if not network and domain not in _KEPT:
                _KEPT[domain] = Domain(domain, LOOPBACK)
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise DataError(
                f"DDS does not start ({error})",
                remedy="see that the network is up, or its configuration",
            ) from None

    def _topic(self, name: str, kind: Kind) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, topic_named(name), CLASSES[kind.name])

    def subscribe(self, name: str, kind: Kind) -> Subscription:
        """Return a subscription to a topic."""
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader

        qos = Qos(
            Policy.Reliability.BestEffort,
            Policy.Durability.Volatile,
            Policy.History.KeepLast(1),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        return Subscription(DataReader(self._participant, self._topic(name, kind), qos=qos))

    def publish(self, name: str, kind: Kind) -> Publication:
        """Return what sends to a topic."""
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.util import duration

        qos = Qos(
            Policy.Reliability.Reliable(duration(milliseconds=100)),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(10),
            Policy.DataRepresentation(use_cdrv0_representation=True),
        )
        return Publication(DataWriter(self._participant, self._topic(name, kind), qos=qos))
