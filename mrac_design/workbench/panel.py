"""Sliders around `design_view`: nothing is computed here."""

from __future__ import annotations

import base64
import html
import io

import ipywidgets as widgets

from mrac_design.errors import MracDesignError
from mrac_design.report.style import CaptionedFigure, styled
from mrac_design.simulation.scenario import Scenario
from mrac_design.workbench.view import (
    DesignValues,
    DesignView,
    design_view,
    initial_values,
    view_figure,
)

SLIDERS = {
    "velocity_gain": ("K₂ (1/s)", 0.0, 200.0, 1.0),
    "bandwidth": ("ω (rad/s)", 50.0, 1000.0, 10.0),
    "damping": ("ξ", 0.3, 2.0, 0.05),
    "observer_pole": ("aₒ (rad/s)", 50.0, 2000.0, 10.0),
    "adaptation_gain": ("γ̂", 0.0, 3.0, 0.01),
    "stiffness": ("true Kₛ (N/m)", 200.0, 2000.0, 20.0),
}
"""Field of DesignValues → label, least value, largest value, step."""

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


class DesignPanel:
    """A design panel: sliders, the figures of merit, the picture, and room for a complaint."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        start = initial_values(scenario)
        self.sliders = {name: _slider(name, getattr(start, name)) for name in SLIDERS}
        self.summary = widgets.HTML()
        self.message = widgets.HTML()
        self.picture = widgets.HTML()
        self.reset = widgets.Button(description="reset", tooltip="back to the scenario's values")
        for slider in self.sliders.values():
            slider.observe(self._changed, names="value")
        self.reset.on_click(lambda _: self._set(start))
        # Without a basis of its own the picture squeezes the sliders' readouts away.
        narrow = widgets.Layout(flex="0 0 22em", overflow="hidden")
        controls = widgets.VBox([*self.sliders.values(), self.reset], layout=narrow)
        answer = widgets.VBox([self.summary, self.message, self.picture])
        self.widget = widgets.HBox([controls, answer])
        self.redraw()

    @property
    def values(self) -> DesignValues:
        """What the sliders say now."""
        return DesignValues(**{name: slider.value for name, slider in self.sliders.items()})

    def redraw(self) -> None:
        """Compute and show the current values; a complaint leaves the last good picture."""
        try:
            view = design_view(self.values, self._scenario)
            picture, summary = _image(view_figure(view)), _summary(view)
        except MracDesignError as problem:
            self.message.value = f'<p style="color:#b3261e">{html.escape(str(problem))}</p>'
            self.picture.layout.opacity = "0.3"
            return
        self.picture.value, self.summary.value, self.message.value = picture, summary, ""
        self.picture.layout.opacity = "1"

    def _changed(self, change: object) -> None:
        self.redraw()

    def _set(self, values: DesignValues) -> None:
        """Move every slider, then draw once."""
        for name, slider in self.sliders.items():
            slider.unobserve(self._changed, names="value")
            slider.value = getattr(values, name)
            slider.observe(self._changed, names="value")
        self.redraw()

    def _repr_mimebundle_(self, **options: object) -> object:
        return self.widget._repr_mimebundle_(**options)


def design_panel(scenario: Scenario) -> DesignPanel:
    """A panel that starts from the values of `scenario`, ready to be shown in a notebook."""
    return DesignPanel(scenario)


def _slider(name: str, value: float) -> widgets.FloatSlider:
    """A slider wide enough for the scenario's own value; it redraws when it is let go."""
    label, least, largest, step = SLIDERS[name]
    return widgets.FloatSlider(
        value=value,
        min=min(least, value),
        max=max(largest, value),
        step=step,
        description=label,
        continuous_update=False,
        readout_format=".4g",
        style={"description_width": "7em"},
    )


def _summary(view: DesignView) -> str:
    gains = ", ".join(
        f"{name.translate(_SUBSCRIPTS)} = {value:.5g}"
        for name, value, _ in view.design.coefficients
    )
    return f"<p>{html.escape(view.text)}<br>{gains}</p>"


def _image(figure: CaptionedFigure) -> str:
    buffer = io.BytesIO()
    with styled():
        figure.savefig(buffer, format="png", dpi=100)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img src="data:image/png;base64,{data}" style="max-width:100%">'
