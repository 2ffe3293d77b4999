#include "drawing/canvas.h"

#include <cairo/cairo-pdf.h>
#include <cairo/cairo-svg.h>
#include <cairo/cairo.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace huetrack::drawing {
namespace {

constexpr const char* font = "DejaVu Sans";

cairo_status_t append(void* closure, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(closure)->append(data, data + length);
  return CAIRO_STATUS_SUCCESS;
}

void check(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(std::string("the picture cannot be drawn: ") + cairo_status_to_string(status));
}

void set_source(cairo_t* cairo, Color c) {
  cairo_set_source_rgba(cairo, c.r / 255.0, c.g / 255.0, c.b / 255.0, c.alpha);
}

void set_font(cairo_t* cairo, double size, Weight weight) {
  cairo_select_font_face(cairo, font, CAIRO_FONT_SLANT_NORMAL,
                         weight == Weight::bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cairo, size);
}

}  // namespace

Color color_of_hue(double hue_deg, double saturation, double value) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60, 6);
    const double v = value - value * saturation * std::max(0.0, std::min({k, 4 - k, 1.0}));
    return int(std::lround(255 * v));
  };
  return {channel(5), channel(3), channel(1)};
}

void Canvas::End::operator()(_cairo* cairo) const {
  cairo_destroy(cairo);
}

void Canvas::End::operator()(_cairo_surface* surface) const {
  cairo_surface_destroy(surface);
}

Canvas::Canvas(int width, int height, Color background, Kind kind) : width_(width), height_(height) {
  if (kind == Kind::svg) {
    file_ = std::make_unique<std::string>();
    surface_.reset(cairo_svg_surface_create_for_stream(&append, file_.get(), width, height));
  } else if (kind == Kind::pdf) {
    file_ = std::make_unique<std::string>();
    surface_.reset(cairo_pdf_surface_create_for_stream(&append, file_.get(), width, height));
    // Otherwise the file contains the current time.
    cairo_pdf_surface_set_metadata(surface_.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  } else {
    surface_.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  }
  check(cairo_surface_status(surface_.get()));
  cairo_.reset(cairo_create(surface_.get()));
  check(cairo_status(cairo_.get()));
  cairo_set_line_join(cairo_.get(), CAIRO_LINE_JOIN_ROUND);
  cairo_set_line_cap(cairo_.get(), CAIRO_LINE_CAP_ROUND);
  rectangle({0, 0, double(width), double(height)}, background);
}

void Canvas::outline(std::span<const Point> points, bool closed) {
  for (const Point& p : points) cairo_line_to(cairo_.get(), p.x(), p.y());  // the first is a move
  if (closed) cairo_close_path(cairo_.get());
}

void Canvas::stroke(Color color, double width) {
  set_source(cairo_.get(), color);
  cairo_set_line_width(cairo_.get(), width);
  cairo_stroke(cairo_.get());
}

void Canvas::fill(Color color) {
  set_source(cairo_.get(), color);
  cairo_fill(cairo_.get());
}

void Canvas::line(const Point& a, const Point& b, Color color, double width) {
  const Point ends[] = {a, b};
  polyline(ends, color, width);
}

void Canvas::dashed(const Point& a, const Point& b, Color color, double width, double dash) {
  cairo_set_line_cap(cairo_.get(), CAIRO_LINE_CAP_BUTT);
  cairo_set_dash(cairo_.get(), &dash, 1, 0);
  line(a, b, color, width);
  cairo_set_dash(cairo_.get(), nullptr, 0, 0);
  cairo_set_line_cap(cairo_.get(), CAIRO_LINE_CAP_ROUND);
}

void Canvas::polyline(std::span<const Point> points, Color color, double width, bool closed) {
  outline(points, closed);
  stroke(color, width);
}

void Canvas::polygon(std::span<const Point> points, Color color) {
  outline(points, true);
  fill(color);
}

void Canvas::circle(const Point& centre, double radius, Color color, double width) {
  cairo_arc(cairo_.get(), centre.x(), centre.y(), radius, 0, 2 * std::numbers::pi);
  stroke(color, width);
}

void Canvas::disc(const Point& centre, double radius, Color color) {
  discs({&centre, 1}, radius, color);
}

void Canvas::discs(std::span<const Point> centres, double radius, Color color) {
  for (const Point& centre : centres) {
    cairo_new_sub_path(cairo_.get());
    cairo_arc(cairo_.get(), centre.x(), centre.y(), radius, 0, 2 * std::numbers::pi);
  }
  fill(color);
}

void Canvas::rectangle(const Box& box, Color color) {
  cairo_rectangle(cairo_.get(), box.x, box.y, box.width, box.height);
  fill(color);
}

double Canvas::text_width(const std::string& text, double size, Weight weight) const {
  set_font(cairo_.get(), size, weight);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo_.get(), text.c_str(), &extents);
  return extents.x_advance;
}

// Sets the font and moves to the start of the text.
void Canvas::start_text(const Point& at, const std::string& text, double size, Align align, Weight weight) const {
  const double share = align == Align::left ? 0 : align == Align::centre ? 0.5 : 1;
  const double width = text_width(text, size, weight);
  cairo_move_to(cairo_.get(), at.x() - share * width, at.y());
}

void Canvas::text(const Point& at, const std::string& text, double size, Color color, Align align, Weight weight) {
  start_text(at, text, size, align, weight);
  set_source(cairo_.get(), color);
  cairo_show_text(cairo_.get(), text.c_str());
  cairo_new_path(cairo_.get());
}

void Canvas::rimmed_text(const Point& at, const std::string& text, double size, Color color, Color rim, Align align) {
  constexpr double rim_width = 2;
  start_text(at, text, size, align, Weight::normal);
  cairo_text_path(cairo_.get(), text.c_str());
  stroke(rim, 2 * rim_width);
  start_text(at, text, size, align, Weight::normal);
  set_source(cairo_.get(), color);
  cairo_show_text(cairo_.get(), text.c_str());
  cairo_new_path(cairo_.get());
}

void Canvas::pixels(const Point& top_left, const BgrPixels& source) {
  const int left = int(std::lround(top_left.x())), top = int(std::lround(top_left.y()));
  const int u_begin = std::max(0, -left), u_end = std::min(source.width, width_ - left);
  cairo_surface_flush(surface_.get());
  std::uint8_t* const data = cairo_image_surface_get_data(surface_.get());
  for (int v = std::max(0, -top); v < std::min(source.height, height_ - top); ++v) {
    const std::uint8_t* from = source.data + std::size_t(v) * source.stride;
    auto* to = reinterpret_cast<std::uint32_t*>(data + std::size_t(top + v) * bgrx_stride()) + left;
    for (int u = u_begin; u < u_end; ++u) {
      const std::uint8_t* p = from + 3 * u;
      to[u] = 0xFF000000U | std::uint32_t(p[2]) << 16 | std::uint32_t(p[1]) << 8 | p[0];
    }
  }
  cairo_surface_mark_dirty(surface_.get());
}

void Canvas::paste(const Point& top_left, const Canvas& other) {
  cairo_surface_flush(other.surface_.get());
  const double left = std::round(top_left.x()), top = std::round(top_left.y());
  cairo_set_source_surface(cairo_.get(), other.surface_.get(), left, top);
  cairo_rectangle(cairo_.get(), left, top, other.width_, other.height_);
  cairo_fill(cairo_.get());
}

Canvas::Clip::Clip(Canvas& canvas, const Box& box) : canvas_(canvas) {
  cairo_save(canvas.cairo_.get());
  cairo_rectangle(canvas.cairo_.get(), box.x, box.y, box.width, box.height);
  cairo_clip(canvas.cairo_.get());
}

Canvas::Clip::~Clip() {
  cairo_restore(canvas_.cairo_.get());
}

std::string Canvas::png() const {
  check(cairo_status(cairo_.get()));
  std::string file;
  check(cairo_surface_write_to_png_stream(surface_.get(), &append, &file));
  return file;
}

std::string Canvas::finished() {
  check(cairo_status(cairo_.get()));
  cairo_surface_finish(surface_.get());
  check(cairo_surface_status(surface_.get()));
  return *file_;
}

void Canvas::next_page() {
  cairo_show_page(cairo_.get());
}

Canvas::Placed::Placed(Canvas& canvas, const Point& origin, double scale) : canvas_(canvas) {
  cairo_save(canvas.cairo_.get());
  cairo_translate(canvas.cairo_.get(), origin.x(), origin.y());
  cairo_scale(canvas.cairo_.get(), scale, scale);
}

Canvas::Placed::~Placed() {
  cairo_restore(canvas_.cairo_.get());
}

const std::uint8_t* Canvas::bgrx() const {
  cairo_surface_flush(surface_.get());
  return cairo_image_surface_get_data(surface_.get());
}

std::size_t Canvas::bgrx_stride() const {
  return std::size_t(cairo_image_surface_get_stride(surface_.get()));
}

}  // namespace huetrack::drawing
