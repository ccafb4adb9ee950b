import { Button, Menu, MenuItem, MenuTrigger, Popover } from 'react-aria-components';
import { startTour } from './tour';

// The menu of the page about itself.
export function Help() {
  return (
    <MenuTrigger>
      <Button className="button help" aria-label="Help">?</Button>
      <Popover className="popover">
        <Menu className="help-menu" aria-label="Help">
          <MenuItem className="option" onAction={startTour}>Tour of the page</MenuItem>
        </Menu>
      </Popover>
    </MenuTrigger>
  );
}
