"""The sections with the options for fitting cages and for deforming."""

from __future__ import annotations

from ..editor import Action, Controller, DeformEditor, actions
from .fields import Field, Section, key_button, option
from .pulling import preserve_toggle, reset_button, volume_label

_MOST_VERTICES = 100_000
_FEWEST_EACH, _MOST_ON_SLIDER = 12, 800  # cage vertices: of a region, and of the slider
_LIDS = {"auto": None, "lids": True, "off": False}
_LIDS_LABELS = (("Auto", "auto"), ("Under lids", "lids"), ("Off", "off"))


def cages_section(editor: DeformEditor) -> Section:
    """Return the options for fitting cages."""
    session, widgets = editor.session, editor.widgets
    options, has_regions = session.options, session.regions is not None
    fitted = sum(cage.n_vertices for cage in session.cages)
    wanted = options.n_cage_vertices
    if wanted == type(options)().n_cage_vertices:
        wanted = widgets.n_cage_vertices  # the default follows the regions
    least = _FEWEST_EACH * max(1, widgets.n_regions)
    largest, decimals = _readable(0.2 * session.mesh.diagonal)
    return Section(
        "cages",
        "Cages",
        (
            Field(
                "cages.detail",
                "slider",
                "Detail",
                "Detail of cages: release to refit them",
                value=widgets.n_cage_vertices,
                enabled=has_regions,
                minimum=least,
                maximum=max(least, _MOST_ON_SLIDER),
                page=50.0,
                on_release=True,
                act=lambda n: lambda controller: actions.fit_cages(controller, n),
            ),
            Field(
                "cages.total",
                "integer",
                "Total cage vertices",
                "Total vertices of all cages (used at next fit)",
                value=wanted,
                minimum=8,
                maximum=_MOST_VERTICES,
                step=10,
                unit=f"({fitted} fitted)" if fitted not in (0, wanted) else "",
                act=option("n_cage_vertices"),
            ),
            Field(
                "cages.offset",
                "number",
                "Offset",
                "Cage offset from the surface (used at next fit)",
                value=options.offset,
                maximum=largest,
                step=10.0**-decimals,
                decimals=decimals,
                special="Auto",
                act=option("offset"),
            ),
            key_button(
                editor.keys,
                "cages.fit",
                "fit_cages",
                "Refit cages" if session.cages else "Fit cages",
                enabled=has_regions,
            ),
            Field(
                "cages.shown",
                "toggle",
                "Show cages in all modes",
                "Show cages outside mode 2 as well",
                "show_cages",
                value=widgets.cages_wanted,
                enabled=bool(session.cages),
                act=lambda _: actions.toggle_cages,
            ),
        ),
    )


def deform_section(editor: DeformEditor) -> Section:
    """Return the options for deforming, and the volume change."""
    session, widgets = editor.session, editor.widgets
    options, has_volume = session.options, session.has_volume
    share = widgets.overlay.wanted_range
    return Section(
        "deform",
        "Deform",
        (
            volume_label(editor, "deform.volume"),
            (
                preserve_toggle(editor, "deform.preserve"),
                Field(
                    "deform.per_region",
                    "toggle",
                    "Per region",
                    "Preserve the volume of each region as well",
                    value=options.preserve_region_volumes and has_volume,
                    visible=has_volume,
                    act=option("preserve_region_volumes"),
                ),
            ),
            Field(
                "deform.overlay",
                "toggle",
                "Show local volume change",
                "Colour the mesh by its local volume change",
                "show_volume_change",
                value=widgets.overlay_wanted,
                act=lambda _: actions.toggle_overlay,
            ),
            Field(
                "deform.range",
                "number",
                "Colour range",
                "Local volume change at the ends of the colour scale",
                value=None if share is None else 100.0 * share,
                visible=widgets.overlay_wanted,
                maximum=1000.0,
                step=5.0,
                decimals=1,
                prefix="±",
                unit="%",
                special="Auto",
                act=_with_range,
            ),
            (
                key_button(
                    editor.keys,
                    "deform.finish",
                    "finish",
                    "Finish pose",
                    enabled=session.can_finish or session.can_finish_further,
                ),
                reset_button(editor, "deform.reset"),
            ),
        ),
    )


def advanced_section(editor: DeformEditor) -> Section:
    """Return the options for deforming that most meshes do not need."""
    session, options = editor.session, editor.session.options
    return Section(
        "advanced",
        "Advanced",
        (
            Field(
                "deform.lids",
                "choice",
                "Open parts",
                "How the volume of open parts is preserved: Auto is under lids unless flat",
                value=next(name for name, lids in _LIDS.items() if lids is options.lids),
                visible=not session.mesh.is_closed,
                choices=_LIDS_LABELS,
                act=lambda name: option("lids")(_LIDS[name]),
            ),
            Field(
                "deform.stretch",
                "number",
                "Stretch resistance",
                "Weight of the stretch energy relative to the detail energy; "
                "0 is the paper's energy",
                value=options.stretch,
                maximum=1e6,
                decimals=2,
                act=option("stretch"),
            ),
            Field(
                "deform.clusters",
                "integer",
                "Rotation clusters",
                "Rotation clusters: fewer is faster, less accurate",
                value=options.rotation_groups,
                maximum=_MOST_VERTICES,
                step=50,
                minimum=1,
                act=option("rotation_groups"),
            ),
            (
                Field(
                    "deform.contact",
                    "toggle",
                    "Avoid contact",
                    "Keep parts of the surface from crossing each other",
                    value=options.avoid_contact,
                    act=option("avoid_contact"),
                ),
                Field(
                    "deform.finishes",
                    "toggle",
                    "Finish on the mesh",
                    "After each drag of a handle, reduce the distortion of the mesh itself",
                    value=editor.controller.finishing.is_wanted,
                    act=_finishing_after_drags,
                ),
            ),
        ),
        advice="For open meshes, contact, speed",
    )


def _with_range(percentage: float | None) -> Action:
    """Return the action that sets the colour range of the overlay; None is automatic."""
    share = None if percentage is None else 0.01 * percentage
    return actions.assigning(lambda c: c.widgets.overlay, "wanted_range", share)


def _finishing_after_drags(wanted: bool) -> Action:
    """Return the action that finishes poses on the mesh after each drag, or no longer."""

    def change(controller: Controller) -> None:
        controller.finishing.is_wanted = wanted
        if wanted:
            controller.finishing.rest()

    return change


def _readable(largest: float) -> tuple[float, int]:
    """Return *largest* with three digits or more, and the decimals for that."""
    decimals = 0
    while largest * 10.0**decimals < 200.0 and decimals < 12:
        decimals += 1
    return round(largest, decimals), decimals
