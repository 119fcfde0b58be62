"""What runs beside the flight because the configuration asks for it: the broker, the page. Made here, started by the live app."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

from companion.config import Config, ConfigError
from companion.io.mqtt import MqttService

if TYPE_CHECKING:
    from companion.telemetry.dashboard.service import DashboardService  # its libraries are an extra


def services_of(config: Config, *, title: str, console: Console) -> list[MqttService | DashboardService]:
    """ConfigError where a section cannot be used. Says on the console where to look."""
    services: list[MqttService | DashboardService] = []
    if config.mqtt.enabled:
        services.append(MqttService(config.mqtt))
        console.print(f"mqtt {config.mqtt.host}:{config.mqtt.port}, topics {config.mqtt.prefix}/#")
    if config.dashboard.enabled:
        page = _page(config, title)
        services.append(page)
        console.print(f"page {page.address}", soft_wrap=True)
    return services


def _page(config: Config, title: str) -> DashboardService:
    try:
        from companion.telemetry.dashboard.service import DashboardService
    except ModuleNotFoundError as error:
        raise ConfigError(f"[dashboard] needs {error.name}: pip install 'companion[web]'") from error
    return DashboardService(config, title=title)
