#include "Vtk/TimesGraph.h"

#include <vtkAxis.h>
#include <vtkBrush.h>
#include <vtkChartLegend.h>
#include <vtkContextActor.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkPlot.h>
#include <vtkRenderer.h>
#include <vtkTextProperty.h>

#include <array>
#include <cstddef>
#include <utility>

namespace palpate::vtk {

void TimesGraph::show(vtkRenderer* renderer, int textSize) {
  m_chart->SetShowLegend(true);
  m_chart->GetLegend()->SetLabelSize(textSize);
  for (const auto& [side, title] :
       {std::pair(vtkAxis::BOTTOM, "frame"), {vtkAxis::LEFT, "time [ms]"}}) {
    vtkAxis* axis = m_chart->GetAxis(side);
    axis->SetTitle(title);
    axis->GetTitleProperties()->SetFontSize(textSize);
    axis->GetTitleProperties()->BoldOff();
    axis->GetLabelProperties()->SetFontSize(textSize);
  }
  vtkNew<vtkBrush> background;
  background->SetColorF(1, 1, 1, 0.75);
  m_chart->SetBackgroundBrush(background);
  vtkNew<vtkContextActor> actor;
  actor->GetScene()->AddItem(m_chart);
  renderer->AddActor(actor);
}

void TimesGraph::add(const FrameStatistics::Stages& ms) {
  constexpr std::array kNames{"frame", "boxes", "octree", "pairs", "narrow phase", "order"};
  constexpr vtkIdType kMostFrames = 300;
  // Okabe and Ito's colours, which colour-blind readers can tell apart.
  constexpr std::array<std::array<double, 3>, 6> kLineColours{{{0, 0, 0},
                                                               {0.90, 0.62, 0},
                                                               {0.34, 0.71, 0.91},
                                                               {0, 0.62, 0.45},
                                                               {0, 0.45, 0.70},
                                                               {0.84, 0.37, 0}}};
  const std::array values{
      static_cast<double>(m_frames), ms.boxes, ms.octree, ms.pairs, ms.narrowPhase, ms.order};
  for (std::size_t i = 0; m_frames == 0 && i < kNames.size(); ++i) {
    vtkNew<vtkDoubleArray> column;
    column->SetName(kNames[i]);
    m_times->AddColumn(column);
  }
  m_times->InsertNextBlankRow();
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    m_times->SetValue(m_times->GetNumberOfRows() - 1, static_cast<vtkIdType>(i), values[i]);
    if (m_frames != 1 || i == 0) continue;  // a line needs two points
    vtkPlot* line = m_chart->AddPlot(vtkChart::LINE);
    line->SetInputData(m_times, 0, static_cast<vtkIdType>(i));
    const auto& [red, green, blue] = kLineColours[i];
    line->SetColor(red, green, blue);
    line->SetWidth(2);
  }
  if (m_times->GetNumberOfRows() > kMostFrames) m_times->RemoveRow(0);
  m_times->Modified();
  m_chart->RecalculateBounds();
  ++m_frames;
}

}  // namespace palpate::vtk
