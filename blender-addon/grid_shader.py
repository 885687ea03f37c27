# SPDX-FileCopyrightText: The Pumice developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader of `floor_grid`: lines of a plane by their distance in pixels, as Blender's `overlay_grid_frag.glsl` has them, over a whole region.

Colors are linear: Blender's texture of overlays is sRGB, and is written and blended in linear values. Rows of the film's depth come from the top.
"""

import gpu
from gpu_extras.batch import batch_for_shader

from .reports import log

# Vectors of four floats alone, so that the layout std140 has no gaps; `numbers` of `floor_grid` writes them in this order.
STRUCT = """
struct GridView {
  vec4 right;       /* of the view, in the world; w: half width at distance 1, or of a parallel view */
  vec4 up;          /* w: the same of the height */
  vec4 forward;     /* w: 1 in perspective */
  vec4 origin;      /* position of the viewer; w: how far it is before the origin of the film's depth, along the view axis */
  vec4 window;      /* center of the window, and the part of the window matrix that makes a depth */
  vec4 reach;       /* distance at which the grid begins to fade; half of further pixels of a line's width; 1 in a camera view */
  vec4 plane;       /* 1 for the axes in the plane of the grid; w: 1 where it is drawn */
  vec4 z_plane;     /* the same of the plane of the z axis; w: sign of the half that is drawn over the grid, 0 without the axis */
  vec4 axes;        /* 1 for the axes that are drawn in the plane of the grid; w: 1 where its lines are */
  vec4 film;        /* width and height of the film; 1 where it hides the grid; 1 where all of the picture does */
  vec4 grid_color;
  vec4 emphasis_color;
  vec4 axis_color[3];
  vec4 steps[2];
};
"""

VERTEX = """
void main()
{
  window_at = pos;
  gl_Position = vec4(pos, 0.0, 1.0);
}
"""

FRAGMENT = """
/* Share of a pixel that a line covers whose middle is this many pixels away: the pixel is taken for a disk of the same area. */
float covered(float off)
{
  const float radius = 0.5641895835477563 * 1.05;
  return 1.0 - smoothstep(0.5 - radius, 0.5 + radius, off);
}

float linear_step(float low, float high, float value)
{
  return clamp((value - low) / max(abs(high - low), 1e-30), 0.0, 1.0);
}

float nearest_line(vec2 p, vec2 pixel, float step_size)
{
  vec2 off = abs(mod(p + 0.5 * step_size, step_size) - 0.5 * step_size) / pixel;
  return covered(min(off.x, off.y) - grid_view.reach.y);
}

float step_at(int i)
{
  return grid_view.steps[i / 4][i % 4];
}

/* Share of a point at this distance along the view axis that the picture leaves to be seen. */
float seen_at(float depth, float depth_per_pixel)
{
  if (grid_view.film.z == 0.0) {
    return 1.0;
  }
  ivec2 size = ivec2(grid_view.film.xy);
  ivec2 pixel = clamp(ivec2((window_at * 0.5 + 0.5) * grid_view.film.xy), ivec2(0), size - 1);
  float hit = texelFetch(film_depth, ivec2(pixel.x, size.y - 1 - pixel.y), 0).r;
  if (grid_view.film.w != 0.0) {
    return hit > 1e30 ? 1.0 : 0.0;
  }
  float from_film = depth + grid_view.origin.w;
  /* A surface in the plane of the grid is above it. */
  from_film += abs(from_film) * 1e-6;
  return hit > 1e30 ? 1.0 : linear_step(from_film, from_film + max(depth_per_pixel, abs(from_film) * 1e-6), hit);
}

/* The lines of a plane through the world's origin: straight alpha. */
vec4 plane_lines(vec3 in_plane, vec3 axes, bool has_grid, float half_of_z)
{
  bool is_perspective = grid_view.forward.w != 0.0;
  vec3 across = vec3(1.0) - in_plane;
  vec2 on_window = (window_at + grid_view.window.xy) * vec2(grid_view.right.w, grid_view.up.w);
  vec3 aside = grid_view.right.xyz * on_window.x + grid_view.up.xyz * on_window.y;
  vec3 start = grid_view.origin.xyz + (is_perspective ? vec3(0.0) : aside);
  vec3 direction = grid_view.forward.xyz + (is_perspective ? aside : vec3(0.0));
  float slope = dot(direction, across);
  float depth = -dot(start, across) / (abs(slope) < 1e-12 ? 1e-12 : slope);
  /* Without the place of the view, which is large where the world is: differences keep their digits. */
  vec3 local = ((is_perspective ? vec3(0.0) : aside) + direction * depth) * in_plane;
  vec3 p = local + grid_view.origin.xyz * in_plane;
  vec3 across_x = dFdx(local), across_y = dFdy(local);
  vec3 pixel = max(abs(across_x) + abs(across_y), vec3(1e-30));
  float depth_per_pixel = abs(dFdx(depth)) + abs(dFdy(depth));

  float fade;
  if (is_perspective) {
    if (depth <= 0.0) {
      return vec4(0.0);
    }
    vec3 back = grid_view.origin.xyz - p;
    float far = length(back);
    float grazing = 1.0 - abs(dot(back / far, across));
    grazing *= grazing;
    fade = (1.0 - grazing * grazing) * (1.0 - smoothstep(0.0, grid_view.reach.x, far - grid_view.reach.x));
  }
  else {
    float far = grid_view.window.w - grid_view.window.z * depth;
    if (abs(far) > 1.0) {
      return vec4(0.0);
    }
    far = grid_view.reach.z != 0.0 ? clamp(far, 0.0, 1.0) : abs(far);
    fade = 1.0 - smoothstep(0.0, 0.5, far - 0.5);
    if (in_plane.z == 0.0) {
      float grazing = 1.0 - abs(grid_view.forward.z);
      grazing *= grazing;
      fade *= 1.0 - grazing * grazing;
    }
  }

  vec4 color = vec4(grid_view.grid_color.rgb, 0.0);
  if (has_grid) {
    vec2 q = in_plane.x == 0.0 ? p.yz : in_plane.y == 0.0 ? p.xz : p.xy;
    vec2 q_pixel = in_plane.x == 0.0 ? pixel.yz : in_plane.y == 0.0 ? pixel.xz : pixel.xy;
    /* Lines begin to appear when they are four pixels apart. */
    float least = dot(across_x, grid_view.right.xyz) * 4.0;
    int i = 7;
    for (int k = 6; k >= 0; k--) {
      i = least < step_at(k) ? k : i;
    }
    float before = i > 0 ? step_at(i - 1) : 0.0;
    float blend = 1.0 - linear_step(before, step_at(i), least);
    blend = blend * blend * blend;
    color = grid_view.grid_color;
    color.a *= nearest_line(q, q_pixel, step_at(i)) * blend;
    color = mix(color, mix(grid_view.grid_color, grid_view.emphasis_color, blend), nearest_line(q, q_pixel, step_at(min(i + 1, 7))));
    color = mix(color, grid_view.emphasis_color, nearest_line(q, q_pixel, step_at(min(i + 2, 7))));
  }
  /* Distance of each axis within the plane. */
  vec3 off = abs(vec3(dot(p.yz, in_plane.yz), dot(p.xz, in_plane.xz), dot(p.xy, in_plane.xy)));
  off /= vec3(dot(pixel.yz, in_plane.yz), dot(pixel.xz, in_plane.xz), dot(pixel.xy, in_plane.xy));
  for (int axis = 0; axis < 3; axis++) {
    float line = axes[axis] != 0.0 ? covered(off[axis] - (0.1 + grid_view.reach.y)) : 0.0;
    if (line >= 1e-8) {
      color = vec4(grid_view.axis_color[axis].rgb, max(color.a, line));
    }
  }
  if (half_of_z != 0.0 && p.z * half_of_z < 0.0) {
    return vec4(0.0);
  }
  color.a *= fade * seen_at(depth, depth_per_pixel);
  return color;
}

vec4 over(vec4 color, vec4 below)
{
  return vec4(color.rgb * color.a, color.a) + below * (1.0 - color.a);
}

void main()
{
  vec4 seen = vec4(0.0);
  float above = grid_view.z_plane.w;
  const vec3 z_axis = vec3(0.0, 0.0, 1.0);
  if (above != 0.0) {
    seen = over(plane_lines(grid_view.z_plane.xyz, z_axis, false, -above), seen);
  }
  if (grid_view.plane.w != 0.0) {
    seen = over(plane_lines(grid_view.plane.xyz, grid_view.axes.xyz, grid_view.axes.w != 0.0, 0.0), seen);
  }
  if (above != 0.0) {
    seen = over(plane_lines(grid_view.z_plane.xyz, z_axis, false, above), seen);
  }
  overlay = seen;
}
"""

_shader = _batch = _nothing = None
# A driver that does not take the shader is asked once.
_refused = False


def _make():
    info, between = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("pumice_grid")
    between.smooth("VEC2", "window_at")
    info.typedef_source(STRUCT)
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "overlay")
    info.uniform_buf(0, "GridView", "grid_view")
    info.sampler(0, "FLOAT_2D", "film_depth")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


def draw(numbers, depth):
    """Draws the grid over the region: `numbers` are those of STRUCT, `depth` the texture of the film's depth, None where there is none."""
    global _shader, _batch, _nothing, _refused
    if _refused:
        return
    if _shader is None:
        try:
            _shader = _make()
        except Exception as error:
            _refused = True
            log(error)
            return
        _batch = batch_for_shader(_shader, "TRIS", {"pos": [(-1.0, -1.0), (3.0, -1.0), (-1.0, 3.0)]})
        _nothing = gpu.types.GPUTexture((1, 1), format="R32F")
    uniform = gpu.types.GPUUniformBuf(gpu.types.Buffer("FLOAT", len(numbers), numbers))
    gpu.state.depth_test_set("NONE")
    gpu.state.depth_mask_set(False)
    gpu.state.blend_set("ALPHA_PREMULT")
    _shader.bind()
    _shader.uniform_block("grid_view", uniform)
    _shader.uniform_sampler("film_depth", depth if depth is not None else _nothing)
    _batch.draw(_shader)
    gpu.state.blend_set("NONE")


def forget():
    """Frees what is on the graphics processor."""
    global _shader, _batch, _nothing
    _shader = _batch = _nothing = None
