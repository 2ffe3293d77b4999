// The one drawing surface of pictures and charts, as pixels, SVG or PDF. Coordinates and sizes are in pixels of the
// finished picture (units of the SVG, points of the PDF), (0,0) is its top left corner, x runs to the right and y down;
// lines and areas are smoothed, and what is outside is not drawn. thread-compatible; canvases know nothing of each
// other.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

// cairo's own names for its types; its headers are behind canvas.cpp.
struct _cairo;          // NOLINT(bugprone-reserved-identifier)
struct _cairo_surface;  // NOLINT(bugprone-reserved-identifier)

namespace huetrack::drawing {

using Point = Eigen::Vector2d;

struct Color {
  int r = 0, g = 0, b = 0;  // 0..255
  double alpha = 1;         // 0: nothing is seen of it, 1: nothing of what is below
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

// Somebody's pixels, 8-bit blue, green, red.
struct BgrPixels {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0;
  std::size_t stride = 0;  // bytes from row to row
};

class Canvas {
 public:
  enum class Kind { pixels, svg, pdf };
  // throws std::runtime_error: no picture of that size can be made
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
  // As text(), with a rim of another colour that keeps it readable over lines.
  void rimmed_text(const Point& at, const std::string& text, double size, Color color, Color rim,
                   Align align = Align::left);
  double text_width(const std::string& text, double size, Weight weight = Weight::normal) const;

  // Only of and onto canvases of pixels, one to one, at the nearest whole pixel.
  void pixels(const Point& top_left, const BgrPixels& source);
  void paste(const Point& top_left, const Canvas& other);

  // While it lives, nothing is drawn outside the box.
  class Clip {
   public:
    Clip(Canvas& canvas, const Box& box);
    ~Clip();
    Clip(const Clip&) = delete;
    Clip& operator=(const Clip&) = delete;

   private:
    Canvas& canvas_;
  };

  // While it lives, (0,0) is at `origin`, and all is drawn so many times as large.
  class Placed {
   public:
    Placed(Canvas& canvas, const Point& origin, double scale = 1);
    ~Placed();
    Placed(const Placed&) = delete;
    Placed& operator=(const Placed&) = delete;

   private:
    Canvas& canvas_;
  };

  void next_page();  // of a PDF: what is drawn from now on is on another page, white

  // What is drawn so far. throw std::runtime_error: memory is out
  std::string png() const;  // of a canvas of pixels: a PNG file
  std::string svg();        // of one of SVG: a file; nothing can be drawn afterwards
  std::string pdf();  // of one of PDF: a file; nothing can be drawn afterwards. The same bytes for the same drawing
  // Of a canvas of pixels: height() rows of width() times blue, green, red and a byte without meaning.
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
  std::unique_ptr<std::string> file_;  // where the surface of an SVG or a PDF writes; it outlives the surface
  std::unique_ptr<_cairo_surface, End> surface_;
  std::unique_ptr<_cairo, End> cairo_;
};

}  // namespace huetrack::drawing
