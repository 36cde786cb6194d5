// Where the pixels of a lens with distortion lie in the pinhole's image: there edges stay straight.
#pragma once

#include <vector>

#include "view.hpp"

// Of one pixel: its centre, and how far a step of one pixel to the right and down goes. Within a pixel the lens is
// taken as linear, which is right to 1e-4 px.
struct Place {
    double x = 0, y = 0;
    double right_x = 1, right_y = 0;
    double down_x = 0, down_y = 1;
};

class Places {
public:
    const int width, height, pad;

    // `pad` more pixels all round than the view has; the view's place and direction do not matter.
    Places(const View &view, int pad);

    Place at(int x, int y) const
    {
        if (table_.empty())
            return {static_cast<double>(x), static_cast<double>(y)};
        return table_[static_cast<std::size_t>(y + pad) * (width + 2 * pad) + (x + pad)];
    }

    // By how much the places of a row's pixels may lie off the straight line between those of two that are
    // no further apart than `block`, in px.
    static constexpr int block = 16;
    double bend() const { return bend_; }

    // Pixels that show something of a rectangle in the pinhole's image; x0 >= x1 or y0 >= y1 when none does.
    Box pixels_of(double x0, double x1, double y0, double y1) const;

private:
    View view_;
    std::vector<Place> table_; // empty without distortion
    double x0_, x1_, y0_, y1_; // of the pinhole's image, that the pixels lie within
    double bend_ = 0.0;
};
