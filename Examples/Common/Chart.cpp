#include "Chart.h"

#include "WriteFile.h"
#include <palpate/Error.h>
#include <palpate/vtk/Window.h>

#include <vtkAxis.h>
#include <vtkChartLegend.h>
#include <vtkChartMatrix.h>
#include <vtkChartXY.h>
#include <vtkContextScene.h>
#include <vtkContextView.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPen.h>
#include <vtkPlotPoints.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSVGExporter.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>
#include <vtkUnsignedCharArray.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace palpate::report {

namespace {

/// The colours of HtmlReport.html, in the same order.
constexpr std::array<std::array<unsigned char, 3>, 12> kColours{{{0x1f, 0x77, 0xb4},
                                                                 {0xd6, 0x27, 0x28},
                                                                 {0x2c, 0xa0, 0x2c},
                                                                 {0x94, 0x67, 0xbd},
                                                                 {0xff, 0x7f, 0x0e},
                                                                 {0x8c, 0x56, 0x4b},
                                                                 {0x17, 0xbe, 0xcf},
                                                                 {0xe3, 0x77, 0xc2},
                                                                 {0x7f, 0x7f, 0x7f},
                                                                 {0xbc, 0xbd, 0x22},
                                                                 {0x39, 0x3b, 0x79},
                                                                 {0x63, 0x79, 0x39}}};

std::size_t columnOf(const Figures& figures, const std::string& key) {
  const auto& keys = figures.textKeys();
  return static_cast<std::size_t>(std::find(keys.begin(), keys.end(), key) - keys.begin());
}

std::vector<std::string> seriesOf(const Figures& figures, const std::string& key) {
  std::vector<std::string> names;
  for (const Figures::Row& row : figures.rows()) {
    const std::string& name = row.texts.at(columnOf(figures, key));
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

using Point = std::array<double, 2>;

std::vector<Point> pointsOf(const Figures& figures, const Diagram& diagram,
                            const std::string& name) {
  std::vector<Point> points;
  for (const Figures::Row& row : figures.rows()) {
    if (row.texts.at(columnOf(figures, diagram.group)) != diagram.value ||
        row.texts.at(columnOf(figures, diagram.series)) != name)
      continue;
    const Point point{row.values[figures.indexOf(diagram.x)],
                      row.values[figures.indexOf(diagram.y)]};
    if (std::isfinite(point[0]) && std::isfinite(point[1])) points.push_back(point);
  }
  if (diagram.lines) std::sort(points.begin(), points.end());
  return points;
}

/// Those that no other is at least as good as in both and better in one.
std::vector<Point> frontOf(const std::vector<Point>& points) {
  std::vector<Point> front;
  for (const Point& p : points)
    if (std::none_of(points.begin(), points.end(),
                     [&](const Point& q) { return q[0] <= p[0] && q[1] <= p[1] && q != p; }))
      front.push_back(p);
  std::sort(front.begin(), front.end());
  return front;
}

/// Line or points, of a colour.
vtkPlotPoints* addPlot(vtkChartXY* chart, const std::vector<Point>& points, const std::string& name,
                       int kind, const std::array<unsigned char, 3>& colour) {
  vtkNew<vtkTable> table;
  for (const int axis : {0, 1}) {
    vtkNew<vtkDoubleArray> column;
    column->SetName(axis == 0 ? "x" : name.c_str());
    for (const Point& point : points) column->InsertNextValue(point[axis]);
    table->AddColumn(column);
  }
  auto* plot = vtkPlotPoints::SafeDownCast(chart->AddPlot(kind));
  plot->SetInputData(table, 0, 1);
  plot->SetColor(colour[0], colour[1], colour[2], 255);
  plot->SetWidth(1.5F);
  plot->SetMarkerStyle(vtkPlotPoints::CIRCLE);
  return plot;
}

void setAxis(vtkAxis* axis, const std::string& label, bool logarithmic,
             const std::vector<double>& values) {
  axis->SetTitle(label);
  axis->GetTitleProperties()->SetBold(false);
  axis->SetLogScale(logarithmic);
  auto [low, high] = std::minmax_element(values.begin(), values.end());
  if (values.empty()) return;
  axis->SetBehavior(vtkAxis::FIXED);
  if (logarithmic) {
    const double margin = std::pow(*high / *low, 0.04) * 1.02;
    axis->SetUnscaledRange(*low / margin, *high * margin);
  } else {
    const double size = std::max(*high - std::min(*low, 0.0), 1.0);
    axis->SetUnscaledRange(std::min(*low, 0.0) - 0.04 * size, *high + 0.04 * size);
  }
}

void fill(vtkChartXY* chart, const Figures& figures, const Diagram& diagram, bool legend) {
  chart->SetTitle(diagram.title);
  chart->SetShowLegend(legend);
  chart->GetLegend()->SetDragEnabled(false);
  chart->GetLegend()->SetVerticalAlignment(vtkChartLegend::CENTER);
  std::vector<Point> all;
  const std::vector<std::string> names = seriesOf(figures, diagram.series);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::vector<Point> points = pointsOf(figures, diagram, names[i]);
    if (points.empty()) continue;
    all.insert(all.end(), points.begin(), points.end());
    addPlot(chart, points, names[i], diagram.lines ? vtkChart::LINE : vtkChart::POINTS,
            kColours[i % kColours.size()])
        ->SetMarkerSize(diagram.lines ? 5.0F : 10.0F);
  }
  if (diagram.front) {
    vtkPlotPoints* front = addPlot(chart, frontOf(all), "best", vtkChart::LINE, {0x44, 0x44, 0x44});
    front->SetMarkerStyle(vtkPlotPoints::NONE);
    front->GetPen()->SetLineType(vtkPen::DASH_LINE);
  }
  std::array<std::vector<double>, 2> values;
  for (const Point& point : all)
    for (const int axis : {0, 1}) values[axis].push_back(point[axis]);
  setAxis(chart->GetAxis(vtkAxis::BOTTOM), figures.quantities()[figures.indexOf(diagram.x)].label,
          diagram.logX, values[0]);
  setAxis(chart->GetAxis(vtkAxis::LEFT), figures.quantities()[figures.indexOf(diagram.y)].label,
          false, values[1]);
}

std::string pngOf(vtkRenderWindow* window) {
  window->Render();
  const int *size = window->GetSize(), width = size[0], height = size[1];
  vtkNew<vtkUnsignedCharArray> pixels;
  window->GetPixelData(0, 0, width - 1, height - 1, 0, pixels);
  const unsigned char* first = pixels->GetPointer(0);
  return vtk::toPng({width, height, {first, first + pixels->GetNumberOfValues()}});
}

}  // namespace

std::vector<std::filesystem::path> draw(const Figures& figures, const Charts& charts,
                                        const std::filesystem::path& path) {
  const int count = static_cast<int>(charts.diagrams.size()),
            rows = (count + charts.columns - 1) / charts.columns;
  vtkNew<vtkContextView> view;
  view->GetRenderer()->SetBackground(1, 1, 1);
  view->GetRenderWindow()->SetMultiSamples(0);
  view->GetRenderWindow()->SetShowWindow(false);
  view->GetRenderWindow()->SetOffScreenRendering(true);
  view->GetRenderWindow()->SetSize(charts.width * charts.columns, charts.height * rows);
  vtkNew<vtkChartMatrix> matrix;
  matrix->SetSize({charts.columns, rows});
  matrix->SetGutter({70, 80});
  matrix->SetBorders(75, 60, 20, 35);
  for (int i = 0; i < count; ++i) {
    auto* chart = vtkChartXY::SafeDownCast(
        matrix->GetChart({i % charts.columns, rows - 1 - i / charts.columns}));
    fill(chart, figures, charts.diagrams[static_cast<std::size_t>(i)], i == 0);
  }
  view->GetScene()->AddItem(matrix);

  std::vector<std::filesystem::path> files;
  std::filesystem::path svg = path, png = path;
  svg += ".svg";
  png += ".png";
  try {
    const auto display = vtk::openDisplay();
    scenes::writeWhole(png, pngOf(view->GetRenderWindow()));
    files.push_back(png);
    vtkNew<vtkSVGExporter> exporter;
    exporter->SetRenderWindow(view->GetRenderWindow());
    exporter->SetFileName(svg.c_str());
    exporter->Write();
    files.push_back(svg);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::NotAvailable) throw;
  }
  return files;
}

}  // namespace palpate::report
