"""What the pipeline does with light: baked into colours, let through by leaves, kept out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, as_lit, convert
from vegtool.errors import UsageError
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Sun
from vegtool.lod import Display, Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live
from vegtool.measure.views import direction, framed
from vegtool.plant import Plant
from vegtool.refine.color import luminances

pytestmark = pytest.mark.gl
OPTIONS = ConvertOptions(billboards=30, levels=1)
BY_RULE = MeasureOptions(measure="off")
SUN = "60,40"


@pytest.fixture(scope="module")
def bush() -> Plant:
    return sample("bush", 800)


@pytest.fixture(scope="module", params=["full", "none"])
def options(request: pytest.FixtureRequest) -> ConvertOptions:
    return replace(OPTIONS, refine=request.param)


@pytest.fixture(scope="module")
def prelit(bush: Plant, options: ConvertOptions) -> LodChain:
    return convert(bush, replace(options, prelit=True, sun=SUN), BY_RULE)


@pytest.fixture(scope="module")
def unlit(bush: Plant, options: ConvertOptions) -> LodChain:
    return convert(bush, options, BY_RULE)


def test_light_that_is_baked_needs_a_sun_and_a_sun_needs_to_be_baked(bush: Plant) -> None:
    with pytest.raises(UsageError, match=r"--prelit: .* --sun"):
        convert(bush, replace(OPTIONS, prelit=True), BY_RULE)
    with pytest.raises(UsageError, match=r"--sun: .* --prelit"):
        replace(OPTIONS, sun=SUN)
    with pytest.raises(UsageError, match=r"--sun: .*azimuth"):
        replace(OPTIONS, prelit=True, sun="noon")
    assert replace(OPTIONS, prelit=True, sun=SUN).baked_sun == Sun(60, 40)
    assert OPTIONS.baked_sun is None


@pytest.mark.parametrize(
    ("name", "value"),
    [("occlusion", -0.1), ("occlusion", 1.5), ("translucency", 2.0), ("crown_normals", -1.0)],
)
def test_shares_lie_between_nothing_and_all(bush: Plant, name: str, value: float) -> None:
    flag = "--" + name.replace("_", "-")
    with pytest.raises(UsageError, match=flag):
        convert(bush, replace(OPTIONS, **{name: value}), BY_RULE)


def test_a_level_with_its_light_needs_no_normals_and_no_light_of_a_client(prelit: LodChain) -> None:
    assert len(prelit.levels) > 1
    assert not prelit.levels[0].unlit
    for level in prelit.levels[1:]:
        assert level.unlit
        if level.atlas is not None:
            assert level.atlas.normal is None and level.atlas.light is None
        if level.mesh is not None:
            assert all(m.unlit and not m.transmission for m in level.mesh.materials)
            assert level.mesh.exposure is None


def test_normals_are_not_touched(
    bush: Plant, prelit: LodChain, unlit: LodChain, options: ConvertOptions,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Neither drawn nor read back nor balanced: those are stages of levels that clients light."""
    of_normals = {"normals", "balance"}
    stages = {stage for level in unlit.levels for stage in level.seconds}
    assert stages & of_normals
    assert "normals" in stages or not any(level.atlas for level in unlit.levels)
    assert not {stage for level in prelit.levels for stage in level.seconds} & of_normals

    def channels(normals: bool, light: bool) -> tuple[str, ...]:
        assert not normals and not light, "a texture that nothing is to be drawn into"
        return ()

    monkeypatch.setattr("vegtool.gl.pictures._channels", channels)
    monkeypatch.setattr("vegtool.refine.level.balanced", lambda *_: pytest.fail("balanced"))
    again = convert(bush, replace(options, prelit=True, sun=SUN), BY_RULE)
    assert level_glb(again.levels[1], "level") == level_glb(prelit.levels[1], "level")


def test_it_says_of_which_sun(prelit: LodChain, unlit: LodChain) -> None:
    assert prelit.baked == Sun(60, 40).as_dict()
    assert prelit.options["sun"] == SUN and prelit.options["prelit"] is True
    assert unlit.baked == {}
    assert not any("horizon" in note for note in prelit.notes)


def test_it_costs_half_the_texels_at_most(
    prelit: LodChain, unlit: LodChain, options: ConvertOptions
) -> None:
    """Colours alone, where there were colours and normals. Which levels there are is decided by
    error where leaves may be triangles, so those of one kind are compared."""
    pairs = list(zip(prelit.levels[1:], unlit.levels[1:], strict=False))
    same = [(a, b) for a, b in pairs if a.atlas is not None and b.atlas is not None]
    assert same or options.refine == "full"
    for a, b in same:
        assert a.texels <= b.texels / 2
    if options.refine == "none":
        assert sum(a.texels for a, _ in pairs) <= sum(b.texels for _, b in pairs) / 2


def test_the_same_bytes_twice(bush: Plant, prelit: LodChain, options: ConvertOptions) -> None:
    again = convert(bush, replace(options, prelit=True, sun=SUN), BY_RULE)
    for one, two in zip(prelit.levels[1:], again.levels[1:], strict=True):
        assert level_glb(one, "level") == level_glb(two, "level")


def test_another_sun_gives_other_colours(
    bush: Plant, prelit: LodChain, options: ConvertOptions
) -> None:
    other = convert(bush, replace(options, prelit=True, sun="240,40"), BY_RULE)
    for one, two in zip(prelit.levels[1:], other.levels[1:], strict=False):
        assert level_glb(one, "level") != level_glb(two, "level")


def test_below_the_horizon_there_is_a_note_and_the_sky_alone(
    bush: Plant, prelit: LodChain, options: ConvertOptions
) -> None:
    night = convert(bush, replace(options, prelit=True, sun="60,-10"), BY_RULE)
    assert any("horizon" in note for note in night.notes)
    assert night.baked["sun"] == 0 and night.baked["elevation_deg"] == -10
    assert brightness(night.levels[1]) < brightness(prelit.levels[1])


def brightness(level: Level) -> float:
    """Of what is seen from aside; its colours are what is seen."""
    drawn = client_plant(level)
    shot_from = framed(drawn.center, drawn.radius, direction(25, 8), 10 * drawn.radius, Display())
    with PlantBuffers(drawn, mipmaps=True) as buffers:
        return float(luminances([live(buffers, shot_from)])[0])


@pytest.fixture(scope="module")
def soft(bush: Plant, options: ConvertOptions) -> LodChain:
    lit = replace(options, occlusion=1.0, translucency=0.4)
    if options.refine == "full":  # large enough that leaves are pictures
        lit = replace(lit, pixels=256.0)
    return convert(bush, lit, BY_RULE)


def test_what_leaves_let_through_and_keep_out_reaches_pictures(soft: LodChain) -> None:
    level = soft.levels[1]
    assert level.atlas is not None and level.atlas.light is not None
    shown = level.atlas.light[level.atlas.color[..., 3] > 127].astype(int)
    assert np.ptp(shown[:, 0]) > 50 and np.ptp(shown[:, 1]) > 50
    assert np.median(shown[:, 3]) == pytest.approx(0.4 * 255, abs=1), "most of it is leaves"
    assert shown[:, 3].max() <= 0.4 * 255 + 1
    assert not level.unlit


def test_the_first_level_is_the_plant_with_what_was_said_of_its_light(
    soft: LodChain, bush: Plant
) -> None:
    mesh = soft.levels[0].mesh
    assert mesh is not None and mesh.exposure is not None
    assert mesh.exposure.min() < 0.5 and mesh.exposure.max() > 0.9
    shares = {m.role: m.transmission for m in mesh.materials}
    assert shares == {"leaf": 0.4, "wood": 0.0}
    assert bush.exposure is None and not any(m.transmission for m in bush.materials)


def test_it_reaches_leaves_that_are_triangles_too(bush: Plant) -> None:
    """For small sizes a refined level is a mesh; where it is, its leaves have their share."""
    lit = replace(OPTIONS, occlusion=1.0, translucency=0.4, pixels=24.0, billboards=64)
    level = convert(bush, lit, BY_RULE).levels[1]
    assert level.kind == "mesh" and level.mesh is not None
    assert level.mesh.exposure is not None
    assert level.mesh.exposure.min() < 0.6
    shares = [m.transmission for m in level.mesh.materials]
    assert max(shares) == pytest.approx(0.4)


def test_without_a_word_the_file_says(bush: Plant) -> None:
    thin = tuple(replace(m, transmission=0.25) for m in bush.materials)
    plant = replace(bush, materials=thin)
    assert as_lit(plant, OPTIONS) is plant
    told = as_lit(plant, replace(OPTIONS, translucency=0.0))
    for material in told.materials:
        assert material.transmission == (0.0 if material.role == "leaf" else 0.25)


def test_half_of_the_occlusion_is_half_of_it_and_with_baked_light_all(bush: Plant) -> None:
    half, full, baked = (
        as_lit(bush, replace(OPTIONS, **how)).exposure  # type: ignore[arg-type]
        for how in ({"occlusion": 0.5}, {"occlusion": 1.0}, {"prelit": True, "sun": SUN})
    )
    assert half is not None and full is not None and baked is not None
    np.testing.assert_allclose(half, (1 + full) / 2)
    np.testing.assert_array_equal(baked, full)


def test_crown_normals_are_those_of_the_levels_alone(bush: Plant) -> None:
    """The original that they are compared with keeps its own."""
    plain = replace(OPTIONS, refine="none")
    one, two = (convert(bush, replace(plain, crown_normals=s), BY_RULE) for s in (0.0, 1.0))
    assert two.levels[0].mesh is bush
    a, b = one.levels[1].atlas, two.levels[1].atlas
    assert a is not None and b is not None and a.normal is not None and b.normal is not None
    if a.normal.shape == b.normal.shape:
        assert (a.normal != b.normal).mean() > 0.1


@pytest.mark.gl
@pytest.mark.parametrize("refine", ["full", "none"])
def test_an_unlit_plant_has_unlit_levels_in_its_own_colours(refine: str) -> None:
    """Colours are what is seen: what a level covers has the mean colour of the plant, unlit."""
    plant = sample("bush", 600)
    unlit = replace(plant, materials=tuple(replace(m, unlit=True) for m in plant.materials))
    options = ConvertOptions(refine=refine, billboards=40, levels=1)
    level = convert(unlit, options, MeasureOptions(measure="off")).levels[1]
    assert level.unlit
    assert level.atlas is not None and level.atlas.normal is None
    covered = level.atlas.color[level.atlas.color[..., 3] > 127][:, :3].astype(float)
    lit = convert(plant, options, MeasureOptions(measure="off")).levels[1]
    assert lit.atlas is not None
    same = lit.atlas.color[lit.atlas.color[..., 3] > 127][:, :3].astype(float)
    assert np.abs(covered.mean(axis=0) - same.mean(axis=0)).max() < 12


@pytest.mark.gl
def test_unlit_beside_lit_is_told() -> None:
    plant = sample("bush", 600)
    first = replace(plant.materials[0], unlit=True)
    mixed = replace(plant, materials=(first, *plant.materials[1:]))
    options = ConvertOptions(refine="none", billboards=20, levels=1)
    notes = convert(mixed, options, MeasureOptions(measure="off")).notes
    assert any(first.name in note and "unlit" in note for note in notes)


@pytest.mark.gl
def test_no_occlusion_with_prelit_is_none() -> None:
    """0 that is asked for is 0: the sky's light reaches all of the plant."""
    plant = sample("bush", 600)
    options = {"refine": "none", "billboards": 20, "levels": 1, "prelit": True, "sun": "60,40"}
    off = MeasureOptions(measure="off")
    open_, usual = (
        convert(plant, ConvertOptions(**options, **more), off).levels[1].atlas
        for more in ({"occlusion": 0.0}, {})
    )
    assert open_ is not None and usual is not None
    assert open_.color[..., :3].mean() > usual.color[..., :3].mean()
