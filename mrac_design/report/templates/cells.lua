-- Code of notebook cells: folded in HTML, left out of the PDF. Figures and tables with a
-- caption are numbered here, so that both outputs carry the same numbers.

local function cell(block)
  if not block.classes:includes("cell") then
    return nil
  end
  if FORMAT:match("html") then
    return {
      pandoc.RawBlock("html", "<details class=\"code\"><summary>Code</summary>"),
      pandoc.CodeBlock(block.text, pandoc.Attr("", { "python" })),
      pandoc.RawBlock("html", "</details>"),
    }
  end
  return {}
end

local function numberer(word)
  local count = 0
  return function(element)
    local first = element.caption.long[1]
    if first == nil then
      return nil
    end
    count = count + 1
    first.content:insert(1, pandoc.Strong(word .. " " .. count .. "."))
    first.content:insert(2, pandoc.Space())
    return element
  end
end

-- In the PDF a short table stays on one page; only a long one may break.
local LONGEST_UNBROKEN = 24

local function kept_together(tbl)
  local rows = 0
  for _, body in ipairs(tbl.bodies) do
    rows = rows + #body.body
  end
  if FORMAT ~= "typst" or rows > LONGEST_UNBROKEN then
    return nil
  end
  return {
    pandoc.RawBlock("typst", "#block(breakable: false, width: 100%)["),
    tbl,
    pandoc.RawBlock("typst", "]"),
  }
end

-- A column without an alignment of its own stands on the left in both outputs.
local function flush_left(tbl)
  for i, column in ipairs(tbl.colspecs) do
    if column[1] == "AlignDefault" then
      tbl.colspecs[i] = { "AlignLeft", column[2] }
    end
  end
  return tbl
end

return {
  { Table = flush_left },
  {
    traverse = "topdown",
    CodeBlock = cell,
    Figure = numberer("Figure"),
    Table = numberer("Table"),
  },
  { Table = kept_together },
}
