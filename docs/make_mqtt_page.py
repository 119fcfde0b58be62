"""docs/mqtt.md out of the table of topics, so that it cannot be wrong: tests/test_docs_mqtt.py compares.

python docs/make_mqtt_page.py
"""

from __future__ import annotations

import json
from pathlib import Path

import msgspec

from companion.config import Mqtt
from companion.telemetry.topics import LARGEST_PAYLOAD, OLDEST_NS, TOPICS, Topic, schema_of

PAGE = Path(__file__).parent / "mqtt.md"

HEAD = """\
# MQTT

Written by docs/make_mqtt_page.py from companion/telemetry/topics.py.

Companion speaks MQTT 5 with a broker. Off by default; on with a few lines of configuration:

```toml
[mqtt]
enabled = true
host = "broker.example.org"
port = 8883
tls = true                       # ca_file for a private authority, certificate_file and key_file for a client certificate
user = "drone"
password_file = "/etc/companion/mqtt-password"
prefix = "companion/drone-1"     # several vehicles, one broker
```

```
mosquitto_sub -h broker.example.org -p 8883 -u drone -P ... -v -t 'companion/drone-1/#'
mosquitto_pub -h broker.example.org -p 8883 -u drone -P ... -t companion/drone-1/command -m '{"action": "hold"}'
```

- Whoever may publish under the prefix can start and abort flights. A broker on another computer is refused without `tls` and `user`,
  unless `insecure = true` says that the network is yours alone. `accept = ["pad"]` takes beacons and no commands; `accept = []` nothing.
- The control loop never waits: it puts messages into a queue of `queue` places; a thread of its own publishes. While the broker is slow or
  away, the oldest go, and how many is said in `health/mqtt_queue` once it is back. Reconnects after 0.2 s, doubling up to `max_backoff_s`.
- After a reconnect the retained topics are sent again, so that a broker that forgot them knows them.
- A retained command is never acted on: a `start` of yesterday must not fly today. It is refused aloud under `event/refused`.
- A command that was taken shows under `event/operator`; what came of it under `phase` and `event/answer`.
"""


def page() -> str:
    """The whole text."""
    parts = [HEAD, "## Topics\n", "Names are below the prefix.\n", _table(), "\n## Payloads\n", _payload_text()]
    parts += [_schema(topic) for topic in TOPICS]
    parts += ["## Settings\n", "| key | default |", "| --- | --- |", *_settings(), ""]
    return "\n".join(parts)


def _table() -> str:
    rows = [
        f"| `{topic.name}` | {topic.direction} | {_rate(topic)} | {'yes' if topic.is_retained else ''} | {topic.qos} | {topic.about} |"
        for topic in TOPICS
    ]
    return "\n".join(["| topic | | at most | retained | QoS | what |", "| --- | --- | --- | --- | --- | --- |", *rows])


def _rate(topic: Topic) -> str:
    return "every one" if topic.rate_hz is None else f"{topic.rate_hz:g} Hz"


def _payload_text() -> str:
    return (
        "One JSON object each. Units and frames stand in the names; `ned` is the autopilot's local frame. `t_ns` is Companion's monotonic\n"
        "clock, `t_unix_ns` the same instant on the wall clock. Incoming messages are checked against these schemas: an unknown key, a number\n"
        f"out of range, more than {LARGEST_PAYLOAD} bytes or an age above {OLDEST_NS / 1e9:g} s (where `t_unix_ns` is given) is refused.\n"
    )


def _schema(topic: Topic) -> str:
    text = json.dumps(schema_of(topic), separators=(", ", ": "))
    return f"<details><summary><code>{topic.name}</code></summary>\n\n```json\n{text}\n```\n\n</details>\n"


def _settings() -> list[str]:
    defaults = msgspec.to_builtins(Mqtt())
    return [f"| `{key}` | `{json.dumps(value)}` |" for key, value in defaults.items()]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
