// Drawing surface of pictures and charts, for pixels, SVG or PDF. Coordinates and sizes are in pixels of the picture
// (units of the SVG, points of the PDF); (0,0) is its top left corner, x right, y down. Antialiased, clipped to the
// picture. thread-compatible.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

// cairo's types; its headers are only in canvas.cpp.
struct _cairo;          // NOLINT(bugprone-reserved-identifier)
struct _cairo_surface;  // NOLINT(bugprone-reserved-identifier)

namespace huetrack::drawing {

using Point = Eigen::Vector2d;

struct Color {
  int r = 0, g = 0, b = 0;  // 0..255
  double alpha = 1;         // 0: transparent, 1: opaque
  constexpr Color faded(double to) const { return {r, g, b, to}; }
  bool operator==(const Color&) const = default;
};

// A colour of this hue (degrees), saturation and value (0..1).
Color color_of_hue(double hue_deg, double saturation, double value);

struct Box {
  double x = 0, y = 0, width = 0, height = 0;
};

enum class Align { left, centre, right };
enum class Weight { normal, bold };

// A view of 8-bit BGR pixels.
struct BgrPixels {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0;
  std::size_t stride = 0;  // bytes from row to row
};

class Canvas {
 public:
  enum class Kind { pixels, svg, pdf };
  // throws std::runtime_error for an impossible size
  Canvas(int width, int height, Color background, Kind kind = Kind::pixels);

  int width() const { return width_; }
  int height() const { return height_; }

  void line(const Point& a, const Point& b, Color color, double width);
  void dashed(const Point& a, const Point& b, Color color, double width, double dash = 4);
  void polyline(std::span<const Point> points, Color color, double width, bool closed = false);
  void polygon(std::span<const Point> points, Color fill);
  void circle(const Point& centre, double radius, Color color, double width);
  void disc(const Point& centre, double radius, Color fill);
  void discs(std::span<const Point> centres, double radius, Color fill);  // faster than one by one
  void rectangle(const Box& box, Color fill);

  // at: on the base line. size: of the font (DejaVu Sans); its capital letters are 0.73 of that high.
  void text(const Point& at, const std::string& text, double size, Color color, Align align = Align::left,
            Weight weight = Weight::normal);
  // As text(), with a rim of another colour for readability.
  void rimmed_text(const Point& at, const std::string& text, double size, Color color, Color rim,
                   Align align = Align::left);
  double text_width(const std::string& text, double size, Weight weight = Weight::normal) const;

  // For pixel canvases only, one to one, at the nearest whole pixel.
  void pixels(const Point& top_left, const BgrPixels& source);
  void paste(const Point& top_left, const Canvas& other);

  // Clips drawing to the box while it exists.
  class Clip {
   public:
    Clip(Canvas& canvas, const Box& box);
    ~Clip();
    Clip(const Clip&) = delete;
    Clip& operator=(const Clip&) = delete;

   private:
    Canvas& canvas_;
  };

  // While it exists, (0,0) is at `origin`, and all is scaled.
  class Placed {
   public:
    Placed(Canvas& canvas, const Point& origin, double scale = 1);
    ~Placed();
    Placed(const Placed&) = delete;
    Placed& operator=(const Placed&) = delete;

   private:
    Canvas& canvas_;
  };

  void next_page();  // PDF: continues on a new white page

  // The drawing so far. throw std::runtime_error if out of memory
  std::string png() const;                  // pixels: a PNG file
  std::string svg() { return finished(); }  // SVG: a file; ends the drawing
  std::string pdf() { return finished(); }  // PDF: a file, reproducible; ends the drawing
  // Pixels: height() rows of width() times blue, green, red and an unused byte.
  const std::uint8_t* bgrx() const;
  std::size_t bgrx_stride() const;  // bytes from row to row

 private:
  std::string finished();
  void outline(std::span<const Point> points, bool closed);
  void stroke(Color color, double width);
  void fill(Color color);
  void start_text(const Point& at, const std::string& text, double size, Align align, Weight weight) const;

  struct End {
    void operator()(_cairo* cairo) const;
    void operator()(_cairo_surface* surface) const;
  };
  int width_, height_;
  std::unique_ptr<std::string> file_;  // output of an SVG or PDF surface, which it outlives
  std::unique_ptr<_cairo_surface, End> surface_;
  std::unique_ptr<_cairo, End> cairo_;
};

}  // namespace huetrack::drawing
